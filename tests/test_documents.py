"""The documents promise only what is there: each example runs, each command is run by a test."""

import ast
import os
import re
import shlex
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from mav_tasks.tasks.lifecycle import TaskReason, words_of
from tests.kit.commands import mav_tasks
from tests.kit.mavproxy import mavproxy
from tests.kit.plugin_example import EXAMPLE
from tests.kit.processes import free_tcp_ports, free_udp_ports, process, stand

ROOT = Path(__file__).resolve().parent.parent
WHERE = ("*.md", ".github/*.md", "mav_tasks/**/*.md", "[dst]*/*.md")
DOCUMENTS = {
    str(path.relative_to(ROOT)): path.read_text(encoding="utf-8")
    for pattern in WHERE
    for path in sorted(ROOT.glob(pattern))
}
README, SIM = DOCUMENTS["README.md"], DOCUMENTS["sim/README.md"]
GUIDE = {Path(name).stem: text for name, text in DOCUMENTS.items() if "/guide/" in name}
CLIENTS, RUNNING, PEOPLE = GUIDE["clients"], GUIDE["running"], GUIDE["people"]
CONTRACT = DOCUMENTS["dialects/README.md"]
ALL = "\n".join(DOCUMENTS.values())
#: the most words of each; all of them are to be read by people who have a rover and a problem
MOST_WORDS = {"README.md": 900, "mav_tasks/guide": 5_600, "dialects": 6_500, "": 18_000}

WITH_CURL = (
    "curl http://127.0.0.1:8560/api/v1/vehicles/1/tasks -H 'Content-Type: application/json'"
    """ -d '{"goals": [{"kind": "move", "distance": 2}]}'"""
)

#: each command that is not run here, and what runs it
COMMANDS = {
    "./tools/demo": "tests/e2e/test_demo.py",
    "mav-tasks web": "tests/kit/web.py",
    WITH_CURL: "tests/e2e/test_web.py",
    "createuser rover": "tests/e2e/test_postgres.py",
    "createdb --owner=rover fleet": "tests/e2e/test_postgres.py",
    "mav-tasks serve --store postgresql://rover@localhost/fleet": "tests/e2e/test_postgres.py",
    "mav-tasks serve --gateway north --store postgresql://rover@localhost/fleet": (
        "tests/e2e/test_postgres.py"
    ),
    "mav-tasks submit move 5 --label patrol --every 1h --deadline 10m": (
        "tests/e2e/test_schedules.py"
    ),
    'mav-tasks mission upload round.waypoints --every "0 6 * * 1-5 Europe/Zurich"': (
        "tests/e2e/test_schedules.py"
    ),
    "mav-tasks keys add agent --role submitter --max-distance 50 --max-speed 0.5 --quota 5": (
        "tests/e2e/test_keys.py"
    ),
    **dict.fromkeys(
        (
            "mav-tasks submit act relay-on",
            "mav-tasks submit act servo --param1 9 --param2 1700",
            "mav-tasks submit act photo --component 100",
            "mav-tasks submit act 2003 --param1 1",
        ),
        "tests/e2e/test_cli.py",
    ),
    "mav-tasks submit move 3 --vehicle any": "tests/e2e/test_cli_fleet.py",
    "mav-tasks modify 12 --every never": "tests/e2e/test_schedules.py",
    "mav-tasks cancel --series 12": "tests/e2e/test_schedules.py",
    "python -m rover_sim.check_vehicle": "tests/sim/test_check_vehicle.py",
}

BROKEN_AT = "### When something breaks"
#: the parts of the README that are run from the first command to the last, as a stranger would
TOUR = README[README.index("## Ten minutes") : README.index(BROKEN_AT)]
BROKEN = README[README.index(BROKEN_AT) : README.index("## From a script")]
#: the parts that are run after a server has written records into the folder that they name
KEYS = PEOPLE[: PEOPLE.index("## Limits\n")]
FILES = RUNNING[RUNNING.index("## Configuration\n") : RUNNING.index("## Metrics\n")] + KEYS


#: what MAVProxy says after each of the lines shown
MAVPROXY_ANSWERS = (
    "AP: Task 1 done",
    "MISSION_ACK: TYPE_MISSION: ACCEPTED",
    "AP: Task 2 done",
    "Set vehicle",
    "",
    "Set vehicle",
)
WAY = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t-35.363262\t149.165237\t584\t1
1\t0\t3\t16\t0\t0\t0\t0\t-35.363253\t149.165237\t0\t1
"""


def blocks(language: str, text: str = ALL) -> list[str]:
    """Return the fenced blocks of one language."""
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def commands(text: str) -> list[str]:
    """Return the commands of its console blocks."""
    return re.findall(r"^\$ (.*)$", "".join(blocks("console", text)), flags=re.MULTILINE)


def is_test(block: str) -> bool:
    """Whether a block is for pytest."""
    return "\ndef test_" in block


#: each example by itself, and what it prints; those of the wire contract go on from one another
EXAMPLES = [
    *(
        pytest.param(block, "task 1", id=block.split("\n")[0])
        for block in blocks("python", README + CLIENTS)
        if not is_test(block)
    ),
    pytest.param("".join(blocks("python", CONTRACT)), "completed", id="dialects/README.md"),
]


def has_command(source: str, command: str) -> bool:
    """Whether a test has a command: as a text, or as arguments; a docstring is no command."""
    tree = ast.parse(source)
    told = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    own = command.removeprefix("mav-tasks ").removeprefix("./")
    words = ["mav_tasks.cli", *shlex.split(own)] if command.startswith("mav-tasks ") else [own]
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in own:
            if own in node.value and id(node) not in told:
                return True
        elif isinstance(node, ast.Tuple | ast.List | ast.Call):
            parts = node.args if isinstance(node, ast.Call) else node.elts
            values = [each.value for each in parts if isinstance(each, ast.Constant)]
            if any(values[at : at + len(words)] == words for at in range(len(values))):
                return True
        elif isinstance(node, ast.BinOp) and getattr(node.right, "value", "") == own:
            return True
    return False


def test_every_command_is_run_somewhere() -> None:
    run_here = {*commands(TOUR), *commands(BROKEN), *commands(FILES)}
    assert set(commands(ALL)) - run_here == set(COMMANDS)
    for command, where in COMMANDS.items():
        source = (ROOT / where).read_text(encoding="utf-8")
        assert has_command(source, command), f"{command}: not in {where}"
        assert not has_command(f"{command!r}  # {command}", command)


@pytest.mark.slow
@pytest.mark.timeout(150)
def test_the_tour_goes_as_it_is_told(tmp_path: Path) -> None:
    (way,) = blocks("waypoints", TOUR)
    first, second, *tour = commands(TOUR)
    assert first.startswith("mav-tasks sim --home ")
    assert second == "mav-tasks serve --store tour.sqlite3"
    (tmp_path / "way.waypoints").write_text(way, encoding="ascii")
    store = tmp_path / "tour.sqlite3"
    with stand(tmp_path, serve_store=str(store), rover_options=rover_options(first)) as it:
        run = partial(
            mav_tasks,
            server=f"udpout:127.0.0.1:{it.client_port}",
            folder=tmp_path,
            MAV_TASKS_STORE=str(store),
        )
        for command in tour:
            done = run(*shlex.split(command)[1:])
            assert (done.status, done.error) == (0, ""), command
            assert done.output.strip(), command
        for number in (1, 2, 3, 4, 5, 8):
            (task,) = run("status", str(number), "--json").objects
            assert (number, task["state"]) == (number, "completed")


@pytest.mark.slow
@pytest.mark.timeout(150)
def test_a_rover_that_breaks_goes_as_it_is_told(tmp_path: Path) -> None:
    broken, *told = commands(BROKEN)
    with stand(tmp_path) as it:
        run = partial(mav_tasks, server=f"udpout:127.0.0.1:{it.client_port}")
        assert run("submit", "move", "0.3", "--wait").status == 0
        it.server.wait_for("Throttle disarmed")
        it.rover.end()
        again = ("-m", "rover_sim", "--port", str(it.rover_port), "--body", "kinematic")
        with process(*again, *rover_options(broken), folder=tmp_path, name="broken") as rover:
            rover.wait_for("rover 1")
            it.server.wait_for("rover 1: restarted")  # nobody types the next command sooner
            ended = [run(*shlex.split(command)[1:]) for command in told]
    assert [done.status for done in ended] == [1, 0, 0]
    moved, queue, resumed = ended
    assert "failed (stuck)" in moved.output
    assert "queue paused (stuck); to let it run, use: mav-tasks resume" in queue.output
    assert resumed.output == "rover 1: resumed\n"


def rover_options(command: str) -> tuple[str, ...]:
    """Return the options with which a document starts the simulated rover."""
    return tuple(shlex.split(command)[2:])


@pytest.mark.parametrize(("folder", "most"), MOST_WORDS.items())
def test_the_documents_are_short(folder: str, most: int) -> None:
    texts = [text for name, text in DOCUMENTS.items() if name.startswith(folder)]
    assert sum(len(text.split()) for text in texts) <= most


@pytest.mark.slow
def test_configuration_and_records_are_as_it_is_told(tmp_path: Path) -> None:
    pytest.importorskip("mcap", reason="the extra mcap is not installed")
    said = commands(FILES)
    serve = next(command for command in said if command.startswith("mav-tasks serve "))
    with stand(tmp_path, *shlex.split(serve)[2:]) as it:
        asked = mav_tasks("vehicles", server=f"udpout:127.0.0.1:{it.client_port}")
        assert asked.status == 0
        it.server.end()
    (record,) = (tmp_path / "records").glob("*.decisions.gz")
    (log,) = (tmp_path / "records").glob("*.tlog")
    stamp = r"\d{4}-\d\d-\d\dT\d\d-\d\d-\d\dZ"
    assert re.fullmatch(stamp + r"\.decisions\.gz", record.name)
    assert re.fullmatch(stamp + r"\.tlog", log.name)
    for command in said:
        if command == serve:
            continue
        named = re.sub(stamp + r"(?=\.decisions)", record.name.partition(".")[0], command)
        named = re.sub(stamp + r"(?=\.tlog)", log.name.partition(".")[0], named)
        done = mav_tasks(*shlex.split(named)[1:], folder=tmp_path, XDG_CONFIG_HOME=str(tmp_path))
        assert done.status == 0, command
        assert not done.error or command in commands(KEYS), done.error
        if command.startswith("mav-tasks replay "):
            assert "same" in done.lines[-1]


def test_the_test_of_a_stranger_is_the_one_that_is_run() -> None:
    (shown,) = [block for block in blocks("python", SIM) if is_test(block)]
    assert shown == EXAMPLE


#: as they are, but for the ports of others
SERVING = sorted(set(re.findall(r"`(mav-tasks serve --[^`]*)`", ALL)))


@pytest.mark.parametrize("command", SERVING)
def test_a_server_that_is_started_so_serves(command: str, tmp_path: Path) -> None:
    client, vehicle = free_udp_ports(2)
    (stream,) = free_tcp_ports(1)
    arguments = shlex.split(command)[1:]
    for old, new in (("14551", vehicle), ("14540", vehicle), ("5760", stream)):
        arguments = [re.sub(rf":{old}$", f":{new}", argument) for argument in arguments]
    arguments += ["--client", f"udpin:127.0.0.1:{client}", "--store", ":memory:"]
    if "--no-push" not in arguments:
        arguments.append("--no-push")
    with process("-m", "mav_tasks.cli", *arguments, folder=tmp_path, name="serve") as server:
        server.wait_for("store in memory")
        server.end()
        assert server.popen.returncode == 0


@pytest.mark.parametrize(("example", "printed"), EXAMPLES)
def test_example_runs(example: str, printed: str, tmp_path: Path) -> None:
    with stand(tmp_path) as it:
        example = example.replace("14560", str(it.client_port))
        example = example.replace("14540", str(it.push_port))
        done = subprocess.run(
            [sys.executable, "-c", example],
            capture_output=True,
            text=True,
            timeout=50,
            check=False,
            env={name: value for name, value in os.environ.items() if name != "MAVLINK20"},
        )
    assert done.returncode == 0, done.stderr
    assert printed in done.stdout.lower()


def test_mavproxy_lines_do_what_they_say(tmp_path: Path) -> None:
    (tmp_path / "way.txt").write_text(WAY, encoding="ascii")
    command = re.search(r"`mavproxy\.py --master udpout:127\.0\.0\.1:14560 (.*?)`", CLIENTS)
    assert command is not None
    (lines,) = blocks("mavproxy", CLIENTS)
    with (
        stand(tmp_path) as it,
        mavproxy(it.client_port, tmp_path, *command[1].split()) as session,
    ):
        session.wait_for(r"Received \d+ parameters\n.*mav\.parm", within=15)
        for line, answer in zip(lines.splitlines(), MAVPROXY_ANSWERS, strict=True):
            session.ask(line, answer, within=20)
            if line.startswith("param set"):  # it says nothing, and sends it a moment later
                it.server.wait_for("parameter {2}: {3}".format(*line.split()))
        assert session.complaints() == []


def anchors(text: str) -> set[str]:
    """Return the anchors of the headings of a document, as GitHub makes them."""
    headings = re.findall(r"^#+ (.+)$", text, flags=re.MULTILINE)
    plain = (re.sub(r"[^\w\- ]", "", heading.lower()) for heading in headings)
    return {heading.replace(" ", "-") for heading in plain}


@pytest.mark.parametrize("name", DOCUMENTS)
def test_every_path_and_link_leads_somewhere(name: str) -> None:
    text, folder = DOCUMENTS[name], (ROOT / name).parent
    for path in re.findall(r"`(?:\./)?((?:tools|tests|dialects|sim)/[\w./]*)`", text):
        assert (ROOT / path).exists(), path
    for path, anchor in re.findall(r"\]\((?!https?:)([^)#]*)#?([^)]*)\)", text):
        target = folder / path if path else ROOT / name
        assert target.exists(), path
        if anchor:
            assert anchor in anchors(target.read_text(encoding="utf-8")), f"{path}#{anchor}"


def test_the_guide_explains_each_reason_to_wait_in_the_words_of_the_command_line() -> None:
    section = GUIDE["trouble"][: GUIDE["trouble"].index("## It refuses to arm\n")]
    words = {words_of(reason) for reason in TaskReason}
    rows = [row for row in section.splitlines() if row.startswith("| ")][1:]
    named = [row.split(" | ")[0].removeprefix("| ") for row in rows]
    split = {
        name for each in named for name in ([each] if each in words else re.split("[;,] ", each))
    }
    assert split - words == {"or another failure", "interrupted", "progress unknown"}
    for reason in TaskReason:
        if reason.NONE < reason < reason.STUCK:
            assert words_of(reason) in section, reason.name


INSIDE = DOCUMENTS["mav_tasks/README.md"]
SOURCES = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "mav_tasks").rglob("*.py"))


def test_the_code_that_developers_are_led_to_is_there() -> None:
    modules = re.findall(r"`((?:\w+/)*\w+\.py)`", INSIDE)
    assert len(modules) > 20
    for module in modules:
        places = (ROOT / "mav_tasks" / module, ROOT / module)
        assert any(place.exists() for place in places), module
    methods = re.findall(r"`([A-Z]\w+)\.(\w+)`", INSIDE)
    assert len(methods) > 8
    for kind, method in methods:
        bodies = re.findall(rf"^class {kind}\b.*?(?=^\S)", SOURCES, flags=re.MULTILINE | re.DOTALL)
        assert any(f"def {method}(" in body for body in bodies), f"{kind}.{method}"
