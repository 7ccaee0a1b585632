"""Every command in a pipe, as a script runs it: what is printed, JSON, exit status."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path

import pytest

from mav_tasks import Move, Refused, SyncClient, Wait, read_plan
from mav_tasks.plans import PlanFile, parse_plan
from tests.kit.commands import Done, called, mav_tasks, session, surroundings
from tests.kit.processes import Stand, frozen, wait_until

NOBODY = "udpout:127.0.0.1:9"
WAY = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t0\t0\t0\t1
1\t0\t2\t54000\t0.1\t0.5\t0\t0\t0\t0\t0\t1
2\t0\t2\t177\t1\t1\t0\t0\t0\t0\t0\t1
"""
PLAN = """{"fileType": "Plan", "version": 1, "mission": {"version": 2, "items": []},
"geoFence": {"version": 2, "polygons": [{"version": 1, "inclusion": true, "polygon":
[[-35.362, 149.164], [-35.362, 149.167], [-35.365, 149.167], [-35.365, 149.164]]}],
"circles": []}, "rallyPoints": {"version": 2, "points": [[-35.3632, 149.1652, 0]]}}"""
NO_FENCE = """{"fileType": "Plan", "version": 1, "mission": {"version": 2, "items": []}}"""


@pytest.fixture(scope="module")
def client(there: Stand) -> Iterator[SyncClient]:
    with SyncClient(f"udpout:127.0.0.1:{there.client_port}", component_id=99) as opened:
        yield opened


@pytest.fixture
def server(there: Stand, client: SyncClient) -> Iterator[str]:
    """The link to the server; nothing of a test is left behind."""
    yield f"udpout:127.0.0.1:{there.client_port}"
    client.clear(running_too=True)
    wait_until(lambda: client.queue().running is None, within=10, what="nothing that runs")
    wait_until(lambda: not client.vehicles()[0].armed, within=10, what="a rover at rest")
    with suppress(Refused):
        client.resume()


def assert_one_line(done: Done, status: int, *words: str) -> None:
    assert done.status == status, done
    assert done.output == ""
    assert len(done.error.splitlines()) == 1, done.error
    assert done.error.startswith("mav-tasks: ")
    for word in words:
        assert word in done.error


def test_help_names_every_command_and_the_exit_statuses_and_is_quick() -> None:
    done = mav_tasks("--help")
    assert done.status == 0
    commands = re.findall(r"^  ([a-z-]+) {2,}[A-Z]", done.output, re.MULTILINE)
    named = """submit status queue cancel clear stop pause resume modify release vehicles mission
    fence rally serve sim demo"""
    assert set(named.split()) <= set(commands)
    for line in ("0  done", "1  a task", "2  usage error", "3  no answer"):
        assert line in done.output
    assert "--install-completion" in done.output


def test_help_loads_nothing_that_it_does_not_need() -> None:
    """How long it takes is the machine's affair; what it loads is ours."""
    code = "import sys; from mav_tasks.cli.app import app\n"
    code += "try: app(['--help'])\nexcept SystemExit: print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=30
    )
    loaded = set(done.stdout.splitlines()[-1].split())
    heavy = {"asyncio", "rich", "pymavlink", "sqlite3", "mav_tasks.client.aio", "json"}
    assert loaded & heavy == set()
    ours = {name for name in loaded if name.startswith("mav_tasks.")}
    assert {name for name in ours if name.split(".")[1] != "cli"} == {
        "mav_tasks.basics",
        "mav_tasks.basics.errors",
        "mav_tasks.client",
        "mav_tasks.client.operations",
    }


def test_it_says_which_version_it_is() -> None:
    assert re.fullmatch(r"mav-tasks \d+\.\d+\.\d+\n", mav_tasks("--version").output)


#: the number of a word of a command, the command, and how that word may go on
COMPLETED = """2 submit  => act drive face goto home move rotate wait
3 submit act v => video-start video-stop
2 sim --bo => --body --boot
3 sim --body  => auto bullet kinematic
3 queue --sign  => """


def test_a_shell_can_complete_commands() -> None:
    it = f"{sys.executable} -m mav_tasks.cli --show-completion"
    shown = subprocess.run(  # in a shell: it prints the completion of the shell that called it
        ["bash", "-c", f"{it}; exit $?"], capture_output=True, text=True, timeout=30, check=True
    )
    assert "_MAV_TASKS_COMPLETE=complete_bash" in shown.stdout
    for number, typed, found in re.findall("(.) (.*) => (.*)", COMPLETED):
        said = {"COMP_WORDS": f"mav-tasks {typed}", "COMP_CWORD": number}
        words = mav_tasks(_MAV_TASKS_COMPLETE="complete_bash", XDG_CONFIG_HOME="/dev", **said)
        assert sorted(words.output.split()) == found.split()


@pytest.mark.parametrize(
    "arguments",
    [
        ("nonsense",),
        ("submit", "move"),
        ("submit", "move", "far"),
        ("submit", "move", "1", "--no"),
        ("queue", "--vehicle", "300"),
    ],
)
def test_what_is_no_command_is_status_2(arguments: tuple[str, ...]) -> None:
    done = called(*arguments)
    assert (done.status, done.output) == (2, "")
    assert "Traceback" not in done.error


@pytest.mark.parametrize(
    "arguments", [("queue",), ("stop",), ("submit", "move", "1"), ("vehicles", "--json")]
)
def test_without_an_answer_the_status_is_3(arguments: tuple[str, ...]) -> None:
    done = called(*arguments, "--timeout", "0.5", server=NOBODY)
    assert_one_line(done, 3, "within 0.5 s")


def test_a_process_ends_with_the_same_status() -> None:
    """Most commands here are called within this process; these are processes of their own."""
    for arguments in (("stop", "--timeout", "0.5"), ("modify", "3")):
        own = mav_tasks(*arguments, server=NOBODY)
        assert own == called(*arguments, server=NOBODY)
        assert own.status in (2, 3)


#: FIRST waits for 60 s, LATER moves in an hour
LOOKED_AT = """modify LATER --label dock-3 => 0 rover 1: task LATER changed
modify LATER --priority 9 => 0 rover 1: task LATER changed
queue --json => "running": FIRST, … "paused": null, … "waiting_count": 1, … "id": LATER, … \
"priority": 8, … "priority": 9, … "left_unit": "s"
status LATER => goal          move -2 m … label         dock-3 … reason        start time
cancel --json => {"done": "cancel", "task": FIRST, "vehicle": 1}
status FIRST --json => "state": "cancel
clear => 0 rover 1: all waiting tasks cancelled
cancel LATER => 1 mav-tasks: … has ended"""


def test_a_task_is_submitted_looked_at_changed_and_called_off(server: str) -> None:
    began = mav_tasks("submit", "wait", "60s", "--priority", "8", server=server)
    assert began.status == 0, began.error  # a busy machine may tell that it waits for a position
    first = began.output.removeprefix("rover 1: task ").strip()

    (waiting,) = called("submit", "move", "-2", "--in", "1h", "--json", server=server).objects
    assert (waiting["what"], waiting["state"]) == ("move -2 m", "scheduled")
    assert (waiting["left"], waiting["left_unit"], waiting["vehicle"]) == (2.0, "m", 1)
    assert 3500 < waiting["time_to_start"] <= 3620

    looked_at = LOOKED_AT.replace("FIRST", first).replace("LATER", str(waiting["id"]))
    changes, calling_off = looked_at.split("\ncancel --json")
    session(server, changes)
    table = mav_tasks("queue", server=server)
    assert table.lines[0].startswith(f"rover 1: task {first} ")
    assert "\x1b" not in table.output
    assert all(line == line.rstrip() for line in table.lines)
    assert table.lines[2].split()[:5] == ["id", "prio", "state", "label", "goal"]
    assert [line.split()[0] for line in table.lines[3:]] == [first, str(waiting["id"])]

    (later,) = called("submit", "move", "1", "--json", server=server).objects
    (last,) = called("submit", "move", "1", "--json", server=server).objects
    called("modify", str(last["id"]), "--before", str(later["id"]), server=server)
    (queue,) = called("queue", "--json", server=server).objects
    assert [task["id"] for task in queue["waiting"]][:2] == [last["id"], later["id"]]
    session(server, f"cancel --json{calling_off}")


def test_finished_tasks_are_listed_newest_first(server: str, client: SyncClient) -> None:
    done = client.submit(Wait(0.1))
    done.done(timeout=20.0)
    gone = client.submit(Move(1.0), delay=600.0)
    gone.cancel()
    last, before = called("history", "--limit", "2", "--json", server=server).objects
    assert (last["id"], last["state"], last["why"]) == (gone.id, "cancelled", None)
    assert (before["id"], before["state"]) == (done.id, "completed")
    assert before["execution_time"] > 0
    ended = datetime.fromisoformat(before["ended_at"])
    assert abs((datetime.now(UTC) - ended).total_seconds()) < 60

    headline, names, *rows = called("history", "--limit", "2", server=server).lines
    assert headline == "rover 1: the last 2 finished tasks"
    assert names.split()[:3] == ["id", "state", "goal"]
    assert [row.split()[0] for row in rows] == [str(gone.id), str(done.id)]
    told = json.loads((Path(__file__).parents[1] / "golden/openapi.json").read_bytes())
    schemas = told["components"]["schemas"]
    (queue,) = called("queue", "--json", server=server).objects
    assert before.keys() <= schemas["Task"]["properties"].keys()
    assert queue.keys() <= schemas["Queue"]["properties"].keys()
    shown = called("status", str(done.id), server=server)
    assert any(re.match(r"ended         \d\d:\d\d:\d\d .*ago$", line) for line in shown.lines)


GOALS = """submit move 1.5 --speed 0.5 => move 1.5 m
submit rotate -90 --rate 30 => rotate -90 deg
submit drive -0.2 10 2s => drive -0.2 m/s for 2 s
submit goto -1 2 --speed 0.7 => go to -1.00 m N, 2.00 m E
submit goto --global -35.36326 149.16524 => go to -35.363260, 149.165240
submit face 270 => face 270 deg
submit home => return home
submit act relay-on => act relay-on
submit act servo --param1 9 --param2 1700 => act servo
submit act photo --component 100 => act photo of component 100
submit act 2003 --param1 1 => act command 2003"""


def test_each_goal_becomes_what_it_says(server: str, client: SyncClient) -> None:
    client.pause()
    for goal, what in re.findall("(.*) => (.*)", GOALS):
        (task,) = called(*goal.split(), "--json", server=server).objects
        assert task["what"] == what
    assert client.queue().waiting_count == 11


@pytest.mark.parametrize("halt", ["pause", "stop"])
def test_who_submits_while_nothing_runs_is_told_so_and_what_to_do(server: str, halt: str) -> None:
    assert called(halt, server=server).status == 0
    done = called("submit", "move", "1", server=server)
    assert done.status == 0
    (line,) = done.lines
    number = line.removeprefix("rover 1: task ")
    why = {"pause": "operator", "stop": "STOP"}[halt]
    assert done.error == (
        f"mav-tasks: rover 1: task {number} waits: the queue is paused ({why});"
        " to let it run, use: mav-tasks resume\n"
    )
    assert called("submit", "move", "1", "--json", server=server).error == ""
    assert called("clear", server=server).status == 0


def test_waiting_tells_each_change_and_ends_as_the_task_does(server: str) -> None:
    done = called("submit", "wait", "0.2s", "--wait", server=server)
    assert done.status == 0
    task = done.lines[0]
    number = int(task.removeprefix("rover 1: task "))
    told = [line.removeprefix(f"{task}: wait 0.2 s: ") for line in done.lines[1:]]
    assert told[-1].startswith("completed")
    assert "executing" in told

    objects = called("submit", "wait", "0.2s", "-w", "--json", server=server).objects
    assert {each["id"] for each in objects} == {number + 1}
    assert objects[-1]["state"] == "completed"
    assert objects[-1]["progress"] == 1.0

    late = called("status", str(number), "--wait", server=server)
    assert (late.status, late.lines[-1].split(": ")[3].split(",")[0]) == (0, "completed")


def test_a_task_that_fails_is_status_1(server: str, client: SyncClient) -> None:
    client.pause()
    first = client.submit_mission(read_way())
    waiting = subprocess.Popen(
        [sys.executable, "-m", "mav_tasks.cli", "status", str(first.id), "--wait"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=surroundings(server),
    )
    assert waiting.stdout is not None
    assert waiting.stdout.readline() == (
        f"rover 1: task {first.id}: plan of 2 items: queued (queue paused);"
        " to let it run, use: mav-tasks resume\n"
    )
    client.cancel(first.id)
    output, error = waiting.communicate(timeout=20)
    assert waiting.returncode == 1
    assert output.startswith(f"rover 1: task {first.id}: plan of 2 items: cancelled")
    assert error.startswith(f"mav-tasks: task {first.id} cancelled")


def read_way() -> PlanFile:
    return parse_plan(WAY)


SESSION = """pause => 0 rover 1: paused. To resume: mav-tasks resume
queue --json => "paused": "operator"
resume => 0 rover 1: resumed
stop --clear => 0 STOP is in force for every rover … mav-tasks resume
queue --json => "paused": "stopped"
stop --vehicle 1 --json => {"done": "stop", "vehicle": 1, "cleared": false, "ended_series": []}
resume --json => {"done": "resume", "vehicle": 1}
queue --json => "paused": null
ready => ready: the server hears rover 1
ready --json => "ready": true
doctor => heard, and its queue runs
submit wait 500 --every 600 --label round => task
queue => executing
submit move 0.1 --json --vehicle 1 => "id"
clear => stays (executing); to cancel it: mav-tasks clear --all
clear --all --yes => all tasks cancelled
submit wait 500 --every 600 --label round => task
queue => executing
status 1 --vehicle 1 --json => "id": 1
release 1 again => 1 mav-tasks:
stop => STOP has ended the series
doctor => queue paused (
submit move 3 => waits: the queue is paused
queue => queue paused (STOP); to let it run
resume => resumed
queue => executing
cancel => cancelled
history --vehicle 1 => the last"""


def test_what_a_session_prints(server: str) -> None:
    session(server, SESSION)


HELD = """queue => held
submit move 1 => 0 rover 1: task … waits: task … is held (
queue => held … release
doctor => WRONG … release
pause => 0
queue --json => "paused": "operator"
resume => 0 rover 1: resumed, but blocked by task … held
submit move 1 --json => "state": "queued"
release skip => 0
queue => executing
clear --all --yes => 0
queue => no task runs"""
SILENT = """queue => silent for
submit move 1 => waits: rover silent; check the rover's radio and power
queue => waits: rover silent; check the rover's radio and power
doctor => WRONG
clear => 0
ready => 1 mav-tasks: the server answers, but does not hear rover 1 (silent for
doctor => WRONG  rover 1 … silent for
vehicles => ago"""


def test_a_held_task_and_a_silent_rover_are_told_with_the_way_on(
    there: Stand, server: str, client: SyncClient
) -> None:
    client.submit(Move(3.0))
    wait_until(lambda: there.speed() > 0.3, within=15, what="the rover at speed")
    with frozen(there.server):
        wait_until(lambda: there.speed() < 0.01, within=15, what="the rover to stop")
    session(server, HELD)
    with frozen(there.rover):
        session(server, SILENT)
    session(server, "queue => no task runs")


def test_rovers_are_shown(server: str) -> None:
    (rover,) = called("vehicles", "--json", server=server).objects
    assert (rover["vehicle"], rover["kind"], rover["heard"]) == (1, "ardupilot", True)
    assert isinstance(rover["north"], float)
    assert 0.0 <= rover["heading"] < 360.0
    names, row = called("vehicles", server=server).lines
    assert names.split()[:3] == ["rover", "kind", "mode"]
    assert row.split()[:2] == ["1", "ardupilot"]


REFUSED = """status 9999 => 1 9999
cancel => 1 no task is running
release again => 1 no task is held
queue --vehicle 7 --timeout 1.5 => 3 rover 7 … rover 1
submit move 1000000 => 1 1000000
submit move nan => 2 any number
submit move 1 --priority 11 => 2 11
submit goto 91 0 --global => 2 91"""


def test_what_is_not_there_or_out_of_range_is_refused(server: str, client: SyncClient) -> None:
    for asked, status, words in re.findall("(.*) => (.) (.*)", REFUSED):
        done = called(*asked.split(), server=server)
        assert_one_line(done, int(status), *words.split(" … "))
    assert client.queue().waiting_count == 0


def test_a_mission_goes_up_waits_is_driven_and_comes_back(server: str, tmp_path: Path) -> None:
    way = tmp_path / "way.waypoints"
    way.write_text(WAY, encoding="utf-8")
    staged = called("mission", "upload", str(way), "--stage", server=server)
    assert re.fullmatch(r"rover 1: task \d+ waits: mav-tasks mission start\n", staged.output)

    for name in ("back.waypoints", "back.plan"):
        back = tmp_path / name
        done = called("mission", "download", str(back), server=server)
        assert done.lines == [f"{back}: 2 items"], done.error
        assert read_plan(back).items == read_plan(way).items
    again = called("mission", "download", str(back), server=server)
    assert_one_line(again, 2, str(back), "--force")
    forced = called("mission", "download", str(back), "--force", "--json", server=server)
    assert forced.objects == [{"file": str(back), "items": 2}]
    printed = called("mission", "download", "-", server=server)
    assert printed.output == back.read_text(encoding="utf-8")

    driven = called("mission", "start", "--wait", "--json", server=server).objects
    assert driven[-1]["state"] == "completed"
    assert f"task {driven[-1]['id']}" in staged.output
    refused = called("mission", "upload", str(way), "--stage", "--after", "3", server=server)
    assert_one_line(refused, 2, "--stage")


FENCE = """fence upload FOLDER/fence.plan => 0 fence: 4 items
fence download FOLDER/back.plan => 0 FOLDER/back.plan
rally upload FOLDER/fence.plan --json => 0 {"done": "rally upload", "items": 1}
fence upload FOLDER/none.plan => 2 mav-tasks: … fence clear
rally upload FOLDER/none.plan => 2 mav-tasks: … rally clear
fence clear => 0
rally clear => 0
fence download FOLDER/away.plan => 1 mav-tasks: … no fence"""


def test_a_fence_and_rally_points_go_up_and_the_fence_comes_back(
    server: str, tmp_path: Path
) -> None:
    for name, text in {"fence": PLAN, "none": NO_FENCE}.items():
        (tmp_path / f"{name}.plan").write_text(text, encoding="utf-8")
    session(server, FENCE.replace("FOLDER", str(tmp_path)))
    assert read_plan(tmp_path / "back.plan").fence == parse_plan(PLAN).fence
    assert not (tmp_path / "away.plan").exists()


def test_a_reader_that_goes_is_no_mishap(server: str, client: SyncClient) -> None:
    with command("queue", "--watch", server=server) as watching:
        assert watching.stdout is not None
        watching.stdout.readline()
        watching.stdout.close()
        client.submit_mission(read_way(), delay=3600)  # and it writes again
        assert watching.wait(20) == 141
        assert watching.stderr is not None
        assert watching.stderr.read() == ""


@contextmanager
def command(*arguments: str, server: str) -> Iterator[subprocess.Popen[str]]:
    running = subprocess.Popen(
        [sys.executable, "-m", "mav_tasks.cli", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**surroundings(server), "PYTHONUNBUFFERED": os.environ.get("PYTHONUNBUFFERED", "")},
    )
    try:
        yield running
    finally:
        if running.poll() is None:
            running.kill()
        running.wait(10)
        for stream in (running.stdout, running.stderr):
            if stream is not None:
                stream.close()
