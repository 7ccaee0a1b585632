"""The fence: what it forbids at submission, at the start, and while driving; rally points."""

from math import inf

from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Driving, Settings, Watch
from mav_tasks.links.memory import Conditions
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import Faults
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, DENIED, DRIVE, RTL
from tests.kit.mission import Download, Item, Upload, acks
from tests.kit.rows import check
from tests.kit.store import LateStore
from tests.kit.world import World, at, is_at
from tests.scenarios.conftest import MakeWorld

REPOSITION, WAYPOINT, RETURN = 192, 16, 20
INCLUSION, EXCLUSION, CIRCLE_IN, CIRCLE_OUT, RALLY = 5001, 5002, 5003, 5004, 5100
FENCE, RALLY_POINTS = 1, 2
GLOBAL = 0
HOME = Item(WAYPOINT, frame=0, current=1)


def corners(command: int, *places: tuple[float, float]) -> list[Item]:
    return [Item(command, **at(*p), param1=len(places), param4=0, frame=0) for p in places]


def box(command: int, south: float, west: float, north: float, east: float) -> list[Item]:
    return corners(command, (south, west), (north, west), (north, east), (south, east))


YARD = box(INCLUSION, -3, -3, 3, 3)
SILENT_AT = 1.0  # m north, where it still drives fast
LOCAL_POSITION_NED, MISSION_COUNT = 32, 44
POND = box(EXCLUSION, 1, -1, 2, 1)


def fenced(world: World, *items: Item, kind: int = FENCE) -> int | None:
    return world.upload(items, kind=kind).result


def go_to(world: World, north: float, east: float) -> tuple[int, int] | None:
    sent = world.client.command_int(REPOSITION, -1, 0, 0, 0, **at(north, east), frame=GLOBAL)
    world.run(0.2)
    return sent.answer


def place(north: float, east: float) -> Item:
    return Item(WAYPOINT, **at(north, east))


def test_a_fence_that_is_none_is_refused_and_the_one_before_stays(world: World) -> None:
    fenced(world, *YARD)
    check(
        world,
        """
fence; IN 2 at=-3,-3; IN 2 at=3,-3 : INVALID_PARAM1 item 1: param1
fence; NAV_FENCE_CIRCLE_INCLUSION -1 at=0,0 : INVALID_PARAM1 item 1: param1 radius -1 m not in
fence; NAV_WAYPOINT at=0,0 : UNSUPPORTED item 1
fence; IN 4 at=-3,-3; IN 4 at=3,-3; IN 4 at=3,3; POND 4 at=1,-1; POND 4 at=2,0 : INVALID
fence; IN 3 at=0,0; IN 3 at=1,0; IN 3 at=2,0 : INVALID
""",
    )
    assert go_to(world, 4, 0) == (DENIED, R.OUTSIDE_FENCE)


@for_each("command", [CIRCLE_IN, CIRCLE_OUT])
def test_a_circle_of_radius_0_is_none_as_mavsdk_has_it(world: World, command: int) -> None:
    no_circle = Item(command, x=0, y=0, param1=0.0, frame=0)
    assert fenced(world, *YARD, no_circle) == 0
    assert len(world.rover.autopilot.missions.stored(FENCE)) == len(YARD), "as it refuses such"
    assert go_to(world, 4, 0) == (DENIED, R.OUTSIDE_FENCE)
    assert go_to(world, 2, 1) == (ACCEPTED, 1)
    download = Download(world.client, kind=FENCE)
    world.until(lambda: download.is_done, within=5)
    assert len(download.items) == len(YARD) + 1


def test_an_item_outside_or_behind_an_exclusion_is_refused_as_it_comes(world: World) -> None:
    fenced(world, *YARD, *POND)
    outside = world.upload((HOME, place(0.5, 0), place(5, 0), place(0, 0)))
    assert (outside.result, outside.requests[-1]) == (14, 2)
    across = world.upload((HOME, place(0.5, 0), place(2.5, 0), place(0, 0)))
    assert (across.result, across.requests[-1]) == (14, 2)
    assert world.upload((HOME, place(0.5, 2), place(2.5, 2), place(2.5, 0))).result == 0


def test_a_move_that_would_leave_it_fails_before_it_begins(world: World) -> None:
    fenced(world, *YARD)
    check(
        world,
        """
TASK_MOVE 5 : ACCEPTED would leave the fence in task 1 after 3.0 m
TASK_MOVE 1 & idle 2 : ACCEPTED task 1: FAILED OUTSIDE_FENCE / task 2: COMPLETED
""",
    )


@for_each("speed", [0.5, 2.0, -2.0])
def test_what_has_no_end_is_stopped_before_the_boundary(world: World, speed: float) -> None:
    fenced(world, *YARD)
    check(
        world,
        f"""
TASK_DRIVE {speed} 0 30 & until 1 HELD : ACCEPTED
wait 3 : - task 1: HELD FENCE / it STANDS
""",
    )
    assert 2.3 < abs(world.truth.north) < 3.0


@for_each("fresh", [0.3, 1.0])
def test_a_rover_that_falls_silent_before_the_boundary_stops_before_it(
    fresh: float,
) -> None:
    """As long as its last words count as fresh it is driven on by them, wherever it is by then."""
    watch = Watch(motion_fresh=fresh, position_lost=2.0)
    # of nobody who observes it: he would not let it drive on data older than by default
    world = World(settings=Settings(watch=watch, driving=Driving(acceleration=1.0))).ready()
    fenced(world, *YARD)
    world.client.command(DRIVE, 2.0, 0, 30, 0, 0, 0, 5)
    world.until(lambda: world.truth.north > SILENT_AT, within=20)
    assert world.truth.forward_speed > 0.9
    world.fault(Faults(withheld=frozenset({LOCAL_POSITION_NED})))
    world.run(4)
    assert world.truth.north < 3.0
    assert world.stands()


def test_a_way_that_a_new_fence_forbids_is_stopped(world: World) -> None:
    check(world, "TASK_MOVE 20 & until 1 EXECUTING : ACCEPTED\nwait 2 : -")
    fenced(world, *YARD)
    check(world, "until 1 HELD & wait 3 : - task 1: HELD FENCE")
    assert world.truth.north < 3.0


def test_a_rover_outside_may_come_back_in(world: World) -> None:
    check(world, "TASK_MOVE 4 & idle 1 : ACCEPTED")
    fenced(world, *YARD)
    check(world, "DO_REPOSITION -1 at=1,0 frame=0 & until 2 COMPLETED : ACCEPTED #2")
    assert is_at(world, 1, 0)


@for_each("how", ["command", "mode"])
def test_a_return_goes_to_the_nearest_rally_point(world: World, how: str) -> None:
    world.until(lambda: world.client.heard("HOME_POSITION"), within=10)
    points = [Item(RALLY, **at(*p)) for p in ((2, 2), (2, -1), (-2, 0))]
    assert fenced(world, *points, kind=RALLY_POINTS) == 0
    world.client.move(2)
    world.until_idle(tasks=1)
    if how == "command":
        world.client.command(RETURN)
    else:
        world.client.mode(RTL)
    world.until_state(2, S.COMPLETED)
    assert is_at(world, 2, -1)


def on_board(world: World, kind: int = FENCE) -> list[tuple[int, int, int]]:
    stored = world.rover.autopilot.missions.stored(kind)
    return [(item.command, item.x, item.y) for item in stored]


@for_each("loss, tries", [(0.0, 1), (0.05, 4)])
def test_the_rover_itself_keeps_it_too(make_world: MakeWorld, loss: float, tries: int) -> None:
    """Of two losses in one upload the rover asks again too late for the client, one time in six."""
    world = make_world(conditions=Conditions(delay=0.01, loss=loss))
    while (result := fenced(world, *YARD)) != 0 and tries > 1:
        assert on_board(world) == []
        tries -= 1
    assert result == 0
    assert on_board(world) == [(item.command, item.x, item.y) for item in YARD]
    for _ in range(tries):  # who clears hears of it, or says it again
        world.client.send(common.MAVLink_mission_clear_all_message(1, 1, 255))
        world.run(1)
    assert on_board(world) == []


@for_each(
    "delay, lost, left, words",
    [
        (inf, (), 4, "not stored in time: nothing changed"),
        (inf, (4, FENCE), 0, "nothing changed; rover 1 did not take its earlier fence"),
        (0.0, (0, RALLY_POINTS), 4, "rover 1 did not answer: not stored"),
    ],
)
def test_the_rover_has_a_fence_again_that_was_not_removed(
    make_world: MakeWorld, delay: float, lost: tuple[int, ...], left: int, words: str
) -> None:
    """``lost``: the count that does not reach it, by its number and its type."""
    store = LateStore()
    world = make_world(store=store)
    fenced(world, *YARD)
    fenced(world, Item(RALLY, **at(1, 1)), kind=RALLY_POINTS)
    store.delay = delay
    world.watched.loses = lambda _, to, data: (
        (to, data[7]) == ("rover1", MISSION_COUNT) and (data[10], data[14]) == lost
    )
    world.client.send(common.MAVLink_mission_clear_all_message(1, 1, 255))
    world.run(3)
    assert (len(on_board(world)), acks(world.client)[-1].result) == (left, 1)
    assert world.client.said(words)


def test_an_acceptance_that_comes_late_is_none_of_a_fence_that_never_reached_the_rover(
    world: World,
) -> None:
    world.watched.loses = lambda _, to, data: (to, data[7]) == ("rover1", MISSION_COUNT)
    upload = Upload(world.client, YARD, kind=FENCE)
    world.run(0.1)
    late = common.MAVLink_mission_ack_message(250, 191, 0, FENCE)
    world.from_vehicle_side(late.pack(common.MAVLink(None, 1, 1)), peer="rover1")
    world.until(lambda: upload.result is not None, within=5)
    assert (upload.result, on_board(world)) == (1, [])
