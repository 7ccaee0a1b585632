"""The server is killed at each point at which it writes, and in each state of a task.

Whatever the point: the rover stands by itself; no acknowledged task is lost, none is there twice;
nothing moves before somebody says so; what ran is held; what waited is in order; STOP is kept.
"""

import signal
import sqlite3
import struct
from collections.abc import Callable
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.processes import (
    Stand,
    command_long,
    free_udp_ports,
    process,
    wait_until,
)
from tests.kit.volume import some

MOVE, ROTATE, STOP, CANCEL, MODIFY = 54000, 54001, 54003, 54010, 54012
CONTINUE, SPEED, REQUEST, WAYPOINT = 193, 178, 512, 16
STANDS_WITHIN = 7.0  # s, its own time-out and braking
QUIET = 1.0  # s in which nothing may move
LONG = 30.0  # m
OVER = (S.COMPLETED, S.FAILED, S.CANCELLED, S.KILLED, S.EXPIRED)
RAN = (S.STARTING, S.EXECUTING, S.CANCELLING)


@dataclass
class Story:
    """One run up to the crash: what was asked for, and what was promised."""

    stand: Stand
    link: Any
    acknowledged: dict[int, int] = field(default_factory=dict)  # nonce -> task
    sent: dict[int, tuple[int, tuple[float, ...]]] = field(default_factory=dict)
    stopped: bool = False
    told_speed: float | None = None  # the parameter TSK_SPEED, after it was set

    def submit(self, command: int, *params: float, after: int = 0, delay: float = 0) -> int:
        """Submit with a nonce; gives the id, 0 if the server was gone before it answered."""
        nonce = 1000 + len(self.sent)
        full = (*params, *(0.0,) * (3 - len(params)), nonce, after, delay, 5.0)
        self.sent[nonce] = command, full
        ack = self.ask(command, *full)
        if ack is None:
            return 0
        assert ack.result == 0, ack
        self.acknowledged[nonce] = ack.result_param2
        return int(ack.result_param2)

    def ask(self, command: int, *params: float) -> Any:
        """Send a command; None if nobody answers because nobody is left."""
        try:
            return command_long(self.link, command, *params)
        except (AssertionError, ConnectionError):
            assert self.stand.server.popen.poll() is not None, "no answer, and the server lives"
            return None

    def drive(self) -> None:
        self.submit(MOVE, LONG)
        wait_until(
            lambda: self.stand.speed() > 0.2 or self.is_dead, within=15, what="the rover to drive"
        )

    def stop(self) -> None:
        self.stopped = True
        if self.ask(STOP) is None:
            self.stopped = False  # not promised

    @property
    def is_dead(self) -> bool:
        return self.stand.server.popen.poll() is not None


def short(story: Story) -> None:
    story.submit(MOVE, 0.3)


def pause(story: Story) -> None:
    story.drive()
    story.submit(MOVE, 0.3)
    story.ask(CONTINUE, 0)


def cancel(story: Story) -> None:
    story.drive()
    story.submit(MOVE, 0.3, delay=600)
    story.ask(CANCEL, 0)


def stop(story: Story) -> None:
    story.drive()
    story.submit(ROTATE, 90)
    story.stop()


def stop_and_store(story: Story) -> None:
    """STOP is answered as soon as the record of halts has it: wait for the database here."""
    stop(story)
    path = story.stand.truth_file.with_name("tasks.sqlite3")
    with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as file:
        query = "SELECT paused FROM vehicles WHERE vehicle = 1"
        wait_until(
            lambda: file.execute(query).fetchone() == (R.STOPPED,),
            within=5,
            what="the latch on the disk",
        )


def stop_idle(story: Story) -> None:
    story.stop()


def scheduled(story: Story) -> None:
    story.submit(MOVE, 0.3, delay=1.0)


def dependent(story: Story) -> None:
    first = story.submit(ROTATE, 20)
    story.submit(MOVE, 0.3, after=first)


def waiting(story: Story) -> None:
    story.ask(CONTINUE, 0)
    for distance in (0.3, 0.4, 0.5):
        story.submit(MOVE, distance)


def modified(story: Story) -> None:
    waiting(story)
    story.ask(MODIFY, 3, 1, 9)


def continued(story: Story) -> None:
    waiting(story)
    story.ask(CONTINUE, 1)


def faster(story: Story) -> None:
    waiting(story)
    story.ask(SPEED, 1, 0.8, -1)


def tuned(story: Story) -> None:
    waiting(story)
    story.link.mav.param_set_send(1, 191, b"TSK_SPEED", 0.8, 9)
    story.told_speed = speed_told(story, within=2)


def cleared(story: Story) -> None:
    waiting(story)
    story.ask(54011, 0)


def drive(story: Story) -> None:
    story.drive()
    story.submit(ROTATE, 90)


def go_to(story: Story) -> None:
    story.link.mav.command_int_send(1, 191, 1, WAYPOINT, 0, 0, 0, 0, 0, 0, -20_000, 10_000, 0)


#: event before and after which the server dies -> what leads to it
WRITES: dict[str, Callable[[Story], None]] = {
    "TaskSubmitted": short,
    "TaskChanged.STARTING": short,
    "TaskChanged.EXECUTING": short,
    "TaskChanged.COMPLETED": short,
    "TaskChanged.PAUSED": pause,
    "TaskChanged.CANCELLING": cancel,
    "TaskChanged.CANCELLED": cancel,
    "TaskChanged.KILLED": stop,
    "TaskChanged.QUEUED": scheduled,
    "QueuePaused": stop_idle,
    "QueueContinued": continued,
    "TaskModified": modified,
    "VehicleSpeedSet": faster,
    "ParameterSet": tuned,
    "TaskAdvanced": go_to,
}
#: what the server is killed in the middle of, from outside
STATES: dict[str, Callable[[Story], None]] = {
    "scheduled": scheduled,
    "blocked and starting": dependent,
    "queued": waiting,
    "executing": drive,
    "paused": pause,
    "stopped": stop_and_store,
    "cleared": cleared,
}
POINTS = [f"{when}:{event}" for event in WRITES for when in ("before", "after")] + list(STATES)


@contextmanager
def running(folder: Path, point: str) -> Any:
    """A rover, and a server that will die at the point; gives the stand."""
    client_port, rover_port, push_port = free_udp_ports(3)
    truth = folder / "truth.csv"
    ready = ("--boot", "none")
    rover = ("-m", "rover_sim", "--port", str(rover_port), "--body", "kinematic", *ready)
    with process(*rover, "--truth", str(truth), folder=folder, name="rover") as rover_process:
        module = ("tests.kit.crashing", point) if ":" in point else ("mav_tasks.cli",)
        with serving(folder, client_port, rover_port, *module, name="first") as server:
            server.wait_for("rover 1: found")
            wait_until(truth.exists, within=20, what="the truth file")
            yield Stand(server, rover_process, client_port, rover_port, push_port, truth)


@contextmanager
def serving(folder: Path, client_port: int, rover_port: int, *module: str, name: str) -> Any:
    serve = ["-m", *module, "serve", "--no-push", "--client", f"udpin:127.0.0.1:{client_port}"]
    serve += ["--vehicle", f"udpout:127.0.0.1:{rover_port}"]
    serve += ["--store", str(folder / "tasks.sqlite3")]
    with process(*serve, folder=folder, name=name) as server:
        yield server


def test_there_are_enough_points() -> None:
    assert len(POINTS) >= 30


#: in each run before one write, after the next; and all states
SOME = [
    number for number in range(len(POINTS)) if number >= 2 * len(WRITES) or number % 4 in (0, 3)
]


@pytest.mark.parametrize("point", some(POINTS, *SOME))
@pytest.mark.timeout(90)
def test_killed_at_any_point(
    tmp_path: Path, point: str, record_property: Callable[[str, object], None]
) -> None:
    script = STATES.get(point) or WRITES[point.partition(":")[2]]
    with running(tmp_path, point) as stand, ExitStack() as stopping:
        story = Story(stand, stand.connect())
        stopping.callback(stand.close)
        script(story)
        if point in STATES:
            stand.server.end(signal.SIGKILL)
        wait_until(lambda: story.is_dead, within=15, what="the server to die")
        wait_until(lambda: stand.speed() < 0.01, within=STANDS_WITHIN, what="the rover to stand")
        stand.close()
        port, rover_port = stand.client_port, stand.rover_port
        with serving(tmp_path, port, rover_port, "mav_tasks.cli", name="second") as server:
            server.wait_for("rover 1: found")
            try:
                check(story, Story(stand, stand.connect()), point, record_property)
            finally:
                stand.close()


def check(
    before: Story, after: Story, point: str, record_property: Callable[[str, object], None]
) -> None:
    where = truth(before.stand)
    states = {task: status(after, task) for task in before.acknowledged.values()}
    assert None not in states.values(), f"an acknowledged task is lost: {states}"
    for task, found in states.items():
        assert found is not None
        state, reason = found
        assert state not in RAN, f"task {task} runs by itself"
        assert (state is S.HELD) == (reason is R.OUTCOME_UNKNOWN)
    for nonce, (command, params) in before.sent.items():
        ack = command_long(after.link, command, *params)
        known = before.acknowledged.get(nonce)
        assert ack.result == 0 or known is None, ack
        assert known in (None, ack.result_param2), "the same submission is another task"
    ids = [task for task in range(1, len(before.sent) + 3) if status(after, task) is not None]
    assert len(ids) == len(before.sent) + (point.endswith("TaskAdvanced"))
    if before.stopped:
        assert queue(after)[0] is R.STOPPED
    if point.endswith("ParameterSet"):
        after.link.mav.param_request_read_send(1, 191, b"TSK_SPEED", -1)
        is_set = before.told_speed is not None or point.startswith("after")
        assert speed_told(after, within=3) == (0.8 if is_set else 0.5)
    if any(found is not None and found[0] is S.HELD for found in states.values()):
        # one that nothing had been asked of yet is in MANUAL, as it was
        wait_until(lambda: beat(after) in (0, 4), within=3, what="the rover in HOLD")
    if nothing_may_run(states, queue(after)[0]):
        quiet_until = truth(before.stand)[2] + QUIET
        wait_until(lambda: truth(before.stand)[2] > quiet_until, within=5)
        moved = [abs(a - b) for a, b in zip(truth(before.stand)[:2], where[:2], strict=True)]
        assert max(moved) < 0.01, "it moved by itself"
    record_property("crash", f"{point:32} {queue(after)[0].name:10} {words(states)}")


def nothing_may_run(states: dict[int, Any], paused: R) -> bool:
    return paused is not R.NONE or any(found and found[0] is S.HELD for found in states.values())


def words(states: dict[int, Any]) -> str:
    return ", ".join(f"{task} {s[0].name} {s[1].name}" for task, s in states.items()) or "-"


def speed_told(story: Story, *, within: float) -> float | None:
    try:
        found = story.link.recv_match(type="PARAM_VALUE", blocking=True, timeout=within)
    except ConnectionError:
        return None
    return None if found is None else round(found.param_value, 3)


def truth(stand: Stand) -> tuple[float, float, float]:
    row = stand.truth()[-1]
    return row["north"], row["east"], row["time"]


def payload(story: Story, number: int, size: int) -> bytes | None:
    """What is shown on request; None: it is not there."""
    message = story.link.recv_match(type=f"UNKNOWN_{number}", blocking=True, timeout=2)
    return None if message is None else bytes(message.get_msgbuf()[10:-2]).ljust(size, b"\0")


def drain(story: Story) -> None:
    while story.link.recv_match(blocking=False) is not None:
        pass


def status(story: Story, task: int) -> tuple[S, R] | None:
    drain(story)
    story.link.mav.command_long_send(1, 191, REQUEST, 0, MOVE, task, 0, 0, 0, 0, 0)
    while True:
        message = story.link.recv_match(
            type=[f"UNKNOWN_{MOVE}", "COMMAND_ACK"], blocking=True, timeout=3
        )
        assert message is not None, "no answer to a request"
        if message.get_type() == "COMMAND_ACK":
            if message.command == REQUEST and message.result != 0:
                return None
            continue
        data = bytes(message.get_msgbuf()[10:-2]).ljust(108, b"\0")[:108]
        fields = struct.unpack("<5I4f4H10B50sI", data)
        if fields[1] == task:
            return S(fields[15]), R(fields[16])


def queue(story: Story) -> tuple[R, int]:
    """Why the queue is paused, and what is next."""
    drain(story)
    story.link.mav.command_long_send(1, 191, REQUEST, 0, 54001, 0, 0, 0, 0, 0, 0)
    data = payload(story, 54001, 78)
    assert data is not None, "no answer to a request"
    return R(data[76]), struct.unpack_from("<I", data, 12)[0]


def beat(story: Story) -> int:
    message = story.link.recv_match(
        type="HEARTBEAT", condition="HEARTBEAT.type==10", blocking=True, timeout=3
    )
    return -1 if message is None else int(message.custom_mode)
