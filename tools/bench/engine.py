"""One engine, and one simulated rover, in this process or in one that has nothing else."""

import gc
import json
import tracemalloc
from collections.abc import Iterator
from dataclasses import replace
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
from rover_sim.errors import MissingExtra
from rover_sim.motion import CONTROL_PERIOD
from rover_sim.vehicle import Vehicle, make_vehicle

from .processes import BUILD, process
from .rows import Row
from .wire import STATION

CHILD = str(Path(__file__).with_name("engine_child.py"))
CALLS = {1: 140, 20: 110, 64: 90}  # commands that wait together: goal
#: endpoints, addresses at each of them, packets from each
STRANGERS = ((1, 1, 1300), (64, 1, 300), (64, 32, 30))
FEW, MANY = 1_000, 100_000  # waiting tasks
SAMPLE = 2_000  # tasks submitted and taken while the others wait
SETTINGS = replace(Settings(), queueing=Queueing(capacity=10 * MANY, quota=10 * MANY))
SUBMITTER = Submitter("link", "127.0.0.1:50000", 255, 190)
SIMULATED, WARM_UP = 30.0, 5.0  # s
SETPOINT_PERIOD = 0.05  # s


def turns(tree: Path) -> Iterator[Row]:
    """Calls and processor time of one TASK_MOVE in the engine, and calls of an idle wake-up."""
    for at_once, goal in CALLS.items():
        what = f"Python calls of one command, {at_once} waiting"
        yield Row(what, _asked(tree, "calls", at_once), goal=f"≤ {goal}")
    yield Row("C calls of one command, 1 waiting", _asked(tree, "c_calls"))
    idle = _asked(tree, "idle")
    yield Row("Python calls of an idle wake-up, median", median(idle), goal="≤ 40")
    yield Row("Python calls of an idle wake-up, most in 10 s", max(idle), goal="≤ 40")
    yield Row("processor of one command", min(_asked(tree, "cpu") for _ in range(3)), "µs")


def strangers(tree: Path) -> Iterator[Row]:
    """Memory and processor time that clients without rights cost, by endpoints × addresses."""
    for case in STRANGERS:
        what = f"strangers, {case[0]} × {case[1]} addresses, {case[2]} packets each"
        goal = f"≤ {64 * case[0]} kB"
        yield Row(f"{what}: memory", _asked(tree, "bytes", *case), "kB", goal=goal)
        yield Row(f"{what}: processor, each", _asked(tree, "seconds", *case), "µs")


def _asked(tree: Path, *words: object) -> Any:
    with process("-P", CHILD, *map(str, words), tree=tree) as it:
        return json.loads(it.wait_for(r"^[\d\[].*\n"))


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
    """A pybullet rover with MAVLink on a circle, real time a second; beside bare stepping."""
    try:
        body = BulletBody(start=Pose())
    except MissingExtra as missing:
        raise ValueError(missing) from missing
    import pybullet  # noqa: PLC0415  # optional

    body.drive(0.5, 0.3)
    body.advance(1 / PHYSICS_RATE)  # sets one physics step per call
    for steps in (round(WARM_UP * PHYSICS_RATE), round(SIMULATED * PHYSICS_RATE)):
        begin = perf_counter()
        for _ in range(steps):
            pybullet.stepSimulation(body._client)
    plain = SIMULATED / (perf_counter() - begin)
    body.close()
    body = BulletBody(start=Pose())
    vehicle = make_vehicle(body, system_id=1, now=0.0)
    now = _driven(vehicle, 0.0)
    before = vehicle.truth
    begin = perf_counter()
    _driven(vehicle, now, SIMULATED)
    ours = SIMULATED / (perf_counter() - begin)
    assert vehicle.truth.north != before.north, "the rover did not move"
    body.close()
    yield Row("simulated rover with MAVLink", ours, "s/s", plain, "stepSimulation", "≥ 0.6×")


def _driven(vehicle: Vehicle, now: float, seconds: float = 0.0) -> float:
    """Stream setpoints to a rover; without ``seconds``, first take it. Return the time."""
    encode = Encoder(Address(250, 191)).encode

    def send(*messages: m.Message) -> None:
        for message in messages:
            vehicle.receive(encode(message), "driver", now=now)

    def run(seconds: float) -> None:
        nonlocal now
        for step in range(round(seconds / CONTROL_PERIOD)):
            now += CONTROL_PERIOD
            if step % round(SETPOINT_PERIOD / CONTROL_PERIOD) == 0:
                velocity = 0, 0, 0, 0.5, 0, 0, 0, 0, 0, 0, 0.3  # m/s and rad/s, BODY_NED
                send(m.SetPositionTargetLocalNed(0, 1, 1, 8, 0x05C7, *velocity))
            if step % round(1 / CONTROL_PERIOD) == 0:
                send(STATION)
            vehicle.handle_deadline(now=now)
            vehicle.take_packets()

    def command(number: int, *params: float) -> m.CommandLong:
        return m.CommandLong(1, 1, number, 0, *(*params, *(0.0,) * 7)[:7])

    if not seconds:
        send(STATION)
        for wanted in (m.LocalPositionNed.id, m.Attitude.id):
            send(command(MavCmd.SET_MESSAGE_INTERVAL, wanted, 1e6 * SETPOINT_PERIOD))
        run(WARM_UP)
        send(command(MavCmd.DO_SET_MODE, 1, 15), command(MavCmd.COMPONENT_ARM_DISARM, 1))
    run(seconds or WARM_UP)
    return now
