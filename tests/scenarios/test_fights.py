"""Somebody or something works against the server all the time: it lets go, and says so."""

from collections.abc import Sequence
from itertools import pairwise

from pymavlink.dialects.v20 import common

from mav_tasks.links.memory import MemoryLink, MemoryNet
from mav_tasks.shell.in_memory import CLIENT_LINK, InMemoryServer
from mav_tasks.store import MemoryStore
from mav_tasks.tasks.events import Event, TaskChanged, TaskWaits
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.body import Body, Pose
from rover_sim.kinematic import KinematicBody
from rover_sim.personas import Mode
from tests.kit.cases import anew, for_each
from tests.kit.client import HOLD, MANUAL, MOVE, PAUSE_CONTINUE
from tests.kit.world import World, near_pose
from tests.scenarios.conftest import MakeWorld


@anew
def driving(world: World) -> World:
    world.client.move(4)
    world.until_faster(0.4)
    return world


class OtherStation:
    """Sets the rover's mode again and again, past the server."""

    def __init__(self, world: World, modes: tuple[int, ...], *, period: float) -> None:
        self._link = world.net.link("other station")
        self._mav = common.MAVLink(None, 255, 190)
        self._period = period
        self._modes = modes
        self._sent = 0
        self._next_at = world.now
        world.join(self)

    def next_deadline(self) -> float:
        return self._next_at

    def turn(self, *, now: float) -> None:
        self._link.receive(len(self._link.arrived))
        if now >= self._next_at:
            self._next_at = now + self._period
            mode = self._modes[self._sent % len(self._modes)]
            self._sent += 1
            message = common.MAVLink_command_long_message(1, 1, 176, 0, 1, mode, *(0.0,) * 5)
            self._link.send("rover1", message.pack(self._mav))


@for_each("modes", [(HOLD,), (MANUAL,), (MANUAL, HOLD)])
def test_nobody_fights_for_the_mode_with_another_station(
    driving: World, modes: tuple[int, ...]
) -> None:
    world = driving
    since = world.now
    OtherStation(world, modes, period=0.3)
    world.until_state(1, S.PAUSED, within=1)
    assert world.state(1) == (S.PAUSED, R.TAKEOVER)
    taken_at = world.now + 0.1
    world.run(10)
    assert world.observer.sent_since(taken_at) == []
    world.until(world.stands, within=2)
    continues = 3
    for _ in range(continues):
        world.client.proceed()
        world.run(2)
    asked = world.observer.sent_since(since).count("GUIDED")
    assert asked <= 5 * continues  # those of one start, for a second at the most
    assert world.state(1)[0] in (S.PAUSED, S.FAILED)
    assert world.stands()


class Rolling(KinematicBody):
    """On a slope: once it moves, nothing brings it below 0.3 m/s."""

    def __init__(self, *, start: Pose) -> None:
        super().__init__(start=start, slip=0.1, seed=None)
        self.brakes = False

    def drive(self, forward_speed: float, yaw_rate: float) -> None:
        rolls = not self.brakes and self.state.forward_speed > 0.25
        super().drive(max(0.35, forward_speed) if rolls else forward_speed, yaw_rate)


def test_a_rover_that_does_not_stop_on_hold_is_told_so_as_long_as_it_moves(
    make_world: MakeWorld,
) -> None:
    bodies: list[Rolling] = []

    def body(start: Pose) -> Body:
        bodies.append(Rolling(start=start))
        return bodies[0]

    world = make_world(body=body)
    world.client.move(4)
    world.until_faster(0.4)
    world.client.move(1)
    since = world.now
    world.client.stop()
    world.run(20)
    assert world.state(1) == (S.KILLED, R.STOP)
    assert world.mode() is Mode.HOLD
    holds = [t for t, m in world.observer.driven if t >= since and is_hold(m)]
    assert len(holds) >= 20
    assert max(b - a for a, b in pairwise([*holds, world.now])) < 1.1
    sent = world.observer.sent_since(since)
    assert "move" not in sent
    assert sent.count("zero") > 60
    world.client.proceed()  # it goes on rolling: nothing begins
    world.run(10)
    assert "move" not in world.observer.sent_since(since)
    assert world.state(2)[0] in (S.QUEUED, S.STARTING, S.FAILED)
    bodies[0].brakes = True
    world.client.stop()
    world.until(lambda: world.stands() and world.control() == "IDLE", within=5)


def is_hold(message: object) -> bool:
    return getattr(message, "command", 0) == 176 and getattr(message, "param2", 0) == HOLD


class Renamed(MemoryNet):
    """The net as a second server knows it: its own links have other names."""

    def __init__(self, world: World) -> None:
        super().__init__()
        self._net = world.net

    def link(self, name: str, *, peers: tuple[str, ...] = ()) -> MemoryLink:
        return self._net.link(f"second {name}", peers=peers)


def test_a_second_server_waits_as_long_as_the_first_one_drives(driving: World) -> None:
    """Of whom the rover does not tell: each is alone with it on a link of its own.

    The HOLD at the end of the first one's task might be a person's, who parks it.
    """
    world = driving
    second = InMemoryServer(Renamed(world), vehicles=("rover1",), now=world.now)
    world.join(second)
    client = world.net.link("its client")
    mav = common.MAVLink(None, 255, 190)
    world.run(3)
    hello = common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    move = common.MAVLink_command_long_message(1, 191, MOVE, 0, 1.0, *(0.0,) * 6)
    for message in (hello, move):
        client.send(f"second {CLIENT_LINK}", message.pack(mav))

    assert isinstance(second.store, MemoryStore)
    theirs = second.store.events
    world.until_state(1, S.COMPLETED, within=30)
    world.run(10)
    assert near_pose(world.pose(), (4.0, 0.0, 0.0))
    goes_on = common.MAVLink_command_long_message(1, 191, PAUSE_CONTINUE, 0, 1.0, *(0.0,) * 6)
    client.send(f"second {CLIENT_LINK}", goes_on.pack(mav))
    world.until(lambda: change_to(S.COMPLETED, theirs), within=30)
    assert near_pose(world.pose(), (5.0, 0.0, 0.0))
    waits = [event.reason for event in theirs if isinstance(event, TaskWaits)]
    assert waits == [R.WRONG_MODE]
    first_ended, second_began = (
        change_to(S.COMPLETED, world.events(TaskChanged)),
        change_to(S.STARTING, theirs),
    )
    assert first_ended[0].at <= second_began[0].at


def change_to(state: S, events: Sequence[Event]) -> list[TaskChanged]:
    return [each for each in events if isinstance(each, TaskChanged) and each.new is state]


@for_each("backwards", [1_000_000, 0])
def test_a_time_of_day_that_goes_back_at_the_rover_changes_nothing(
    driving: World, backwards: int
) -> None:
    """SYSTEM_TIME says what a GPS says; a restart is told by ``time_boot_ms`` of the motion."""
    world = driving
    message = common.MAVLink_system_time_message(backwards, backwards)
    world.from_vehicle_side(message.pack(common.MAVLink(None, 1, 1)), peer="rover1")
    world.until_idle(tasks=1)
    assert world.history(1)[-1] == (S.COMPLETED, R.NONE)
    assert (S.HELD, R.FRAME_RESET) not in world.history(1)
