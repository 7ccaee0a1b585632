"""One engine, and one simulated rover, in this process or in one that has nothing else."""

import gc
import json
import subprocess
import sys
import tracemalloc
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from itertools import repeat
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import monotonic, perf_counter
from typing import Any

from mav_tasks.config.settings import Queueing, Settings
from mav_tasks.engine.engine import Engine
from mav_tasks.kinds import Move
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.shell.serve import tame_collector
from mav_tasks.store.sqlite import SqliteStore
from mav_tasks.tasks.pending_tasks import PendingTasks
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import Draft, Marks, Submitter, Terms
from rover_sim.body import Pose
from rover_sim.bullet import PHYSICS_RATE, BulletBody
from rover_sim.motion import CONTROL_PERIOD
from rover_sim.vehicle import make_vehicle

from .processes import BUILD, environment
from .rows import Row
from .speed import timed
from .wire import STATION

CHILD = str(Path(__file__).with_name("engine_child.py"))
CALLS = {1: 140, 20: 110, 64: 90}  # commands that wait together: goal
#: endpoints, addresses at each of them, packets from each
STRANGERS = ((1, 1, 1300), (64, 1, 300), (64, 32, 30))
FEW, MANY = 1_000, 100_000  # waiting tasks
SAMPLE = 2_000  # tasks submitted and taken while the others wait
SETTINGS = replace(Settings(), queueing=Queueing(capacity=10 * MANY, quota=10 * MANY))
SUBMITTER = Submitter("link", "127.0.0.1:50000", 255, 190)
SIMULATED = 30.0  # s
STEPS = round(SIMULATED * PHYSICS_RATE)
SETPOINT = m.SetPositionTargetLocalNed(0, 1, 1, 8, 0x05C7, 0, 0, 0, 0.5, 0, 0, 0, 0, 0, 0, 0.3)
#: a driver's commands, by their time
TAKING = {
    at: m.CommandLong(1, 1, number, 0, first, second, 0, 0, 0, 0, 0)
    for at, number, first, second in (
        (1.05, MavCmd.SET_MESSAGE_INTERVAL, m.LocalPositionNed.id, 5e4),
        (1.1, MavCmd.SET_MESSAGE_INTERVAL, m.Attitude.id, 5e4),
        (5.05, MavCmd.DO_SET_MODE, 1, 15),
        (5.1, MavCmd.COMPONENT_ARM_DISARM, 1, 0),
    )
}


def turns(tree: Path) -> Iterator[Row]:
    """Calls and processor time of one TASK_MOVE in the engine, and calls of an idle wake-up."""
    for at_once, goal in CALLS.items():
        what = f"Python calls of one command, {at_once} waiting"
        yield Row(what, _asked(tree, "calls", at_once), goal=f"≤ {goal}")
    idle = _asked(tree, "idle")
    yield Row("Python calls of an idle wake-up, median", median(idle), goal="≤ 40")
    yield Row("Python calls of an idle wake-up, most in 10 s", max(idle), goal="≤ 40")
    yield Row("processor of one command", min(_asked(tree, "cpu") for _ in range(3)), "µs")


def strangers(tree: Path) -> Iterator[Row]:
    """Memory and processor time that clients without rights cost, by endpoints × addresses."""
    for case in STRANGERS:
        what = f"strangers, {case[0]} × {case[1]} addresses, {case[2]} packets each"
        memory, seconds = _asked(tree, "strangers", *case)
        yield Row(f"{what}: memory", memory, "kB", goal=f"≤ {64 * case[0]} kB")
        yield Row(f"{what}: processor, each", seconds, "µs")


def _asked(tree: Path, *words: object) -> Any:
    command = [sys.executable, "-P", CHILD, *map(str, words)]
    return json.loads(subprocess.check_output(command, env=environment(tree)))


def queue(_tree: Path) -> Iterator[Row]:
    """100,000 waiting tasks: the time to submit and take one, memory, restart; beside 1,000."""
    tame_collector()  # as the server does
    few, many = _submitted(FEW), _submitted(MANY)
    beside = f"with {FEW:,}"
    yield Row(f"submit + take a task, {MANY:,} wait", many, "µs", few, beside, "≤ 2×")
    tracemalloc.start()
    book, room = _filled(10 * FEW)
    book.take_events()
    size = tracemalloc.get_traced_memory()[0] / (10 * FEW)
    tracemalloc.stop()
    del room
    yield Row("memory of a waiting task", size, "bytes", goal="≤ 2,048 bytes")
    with TemporaryDirectory(dir=BUILD) as folder:
        path = Path(folder, "tasks.sqlite3")
        store = SqliteStore(path, wall_offset=lambda: 0.0)
        book, _ = _filled(MANY)
        store.append(book.take_events())
        store.close()
        del book
        gc.collect()
        gc.disable()  # like the server, until everything is restored
        begin = perf_counter()
        store = SqliteStore(path, wall_offset=lambda: 0.0)
        Engine(SETTINGS, now=monotonic(), restored=store.load())
        yield Row(f"restart with {MANY:,} waiting", perf_counter() - begin, "s", goal="≤ 3 s")
        tame_collector()
        store.close()


def _draft(number: int) -> Draft:
    marks = Marks(number, f"{number:018x}", f"{number:018x}")
    return Draft(1, 54000, Move(1.0 + number), SUBMITTER, Terms(priority=number % 11), marks)


def _filled(count: int) -> tuple[TaskRegistry, PendingTasks]:
    book = TaskRegistry()
    room = PendingTasks(book, SETTINGS)
    for number in range(count):
        room.submit(_draft(number), now=number * 1e-3)
    return book, room


def _submitted(count: int) -> float:
    """Return the seconds to submit and take a task while others wait."""
    book, room = _filled(count)
    book.take_events()
    drafts = [_draft(count + number) for number in range(SAMPLE)]
    begin = perf_counter()
    for draft in drafts:
        room.submit(draft, now=count * 1e-3)
    for _ in range(SAMPLE):
        first = room.queue(1).first()
        assert first is not None
        room.leave(book[first])
    return (perf_counter() - begin) / SAMPLE


def simulation(_tree: Path) -> Iterator[Row]:
    """A pybullet rover with MAVLink on a circle, seconds a second; beside bare stepping."""
    import pybullet  # noqa: PLC0415  # optional

    body = BulletBody(start=Pose())
    body.drive(0.5, 0.3)
    body.advance(1 / PHYSICS_RATE)  # sets one physics step per call
    plain = timed(lambda: deque(map(pybullet.stepSimulation, repeat(body._client, STEPS)), 0))
    body.close()
    vehicle = make_vehicle(BulletBody(start=Pose()), system_id=1, now=0.0)
    encode = Encoder(Address(250, 191)).encode

    def run() -> None:
        for step in range(round(SIMULATED / CONTROL_PERIOD)):
            now = step * CONTROL_PERIOD
            if step % round(0.05 / CONTROL_PERIOD) == 0:
                beat = STATION if step % round(1 / CONTROL_PERIOD) == 0 else SETPOINT
                vehicle.receive(encode(TAKING.get(round(now, 2), beat)), "driver", now=now)
            vehicle.handle_deadline(now=now)
            vehicle.take_packets()

    ours = SIMULATED / timed(run)
    assert abs(vehicle.truth.north) > 0.1, "the rover did not move"
    what = "simulated rover with MAVLink"
    yield Row(what, ours, "s/s", SIMULATED / plain, "stepSimulation", "≥ 0.6×")
