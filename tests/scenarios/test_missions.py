"""Plans: uploaded, looked at, started, driven, cleared."""

from math import inf

from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Settings
from mav_tasks.engine.inputs import PeerChanged
from mav_tasks.shell.in_memory import CLIENT_LINK
from mav_tasks.tasks.events import TaskChanged
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.cases import for_each
from tests.kit.client import (
    ACCEPTED,
    sticks,
)
from tests.kit.mission import Download, Item, Upload, acks, currents, reached
from tests.kit.rows import ask, check
from tests.kit.store import LateStore
from tests.kit.world import World, at, is_at
from tests.scenarios.conftest import MakeWorld

WAYPOINT, SERVO, MODE = 16, 183, 176
START = 300
HOME = Item(WAYPOINT, frame=0, current=1)
COMPLETE = 5


def place(north: float, east: float, *, hold: float = 0.0, radius: float = 0.0) -> Item:
    return Item(WAYPOINT, **at(north, east), param1=hold, param2=radius)


PLAN = (HOME, place(1.5, 0), place(1.5, 1.5), place(0, 1.5, hold=0.5))


def uploaded(world: World, *items: Item, target: tuple[int, int] = (1, 1)) -> Upload:
    return world.upload(items or PLAN, target=target)


def set_current(seq: int) -> common.MAVLink_message:
    return common.MAVLink_mission_set_current_message(1, 1, seq)


def clear_all(kind: int = 0) -> common.MAVLink_message:
    return common.MAVLink_mission_clear_all_message(1, 1, kind)


def start(world: World) -> tuple[int, int] | None:
    sent = world.client.command(START, target=(1, 1))
    world.run(0.2)
    return sent.answer


def test_a_plan_waits_until_it_is_started_and_is_driven(world: World) -> None:
    upload = uploaded(world)
    assert (upload.result, upload.opaque_id, upload.requests) == (0, 1, [0, 1, 2, 3])
    world.run(3)
    status = world.shown(1)
    assert (status.state, status.reason) == (S.BLOCKED, R.WAITING_FOR_START)
    assert start(world) == (ACCEPTED, 1)
    world.until_state(1, S.COMPLETED, within=60)
    assert reached(world.client) == [1, 2, 3]
    assert is_at(world, 0.0, 1.5)
    last = currents(world.client)[-1]
    assert (last.seq, last.total, last.state, last.mission_id) == (3, 4, COMPLETE, 1)


def test_the_same_plan_again_a_moment_later_is_the_same_task(world: World) -> None:
    plan = (place(1, 0), place(1, 1))
    first = uploaded(world, *plan, target=(1, 191))
    world.run(2)
    again = uploaded(world, *plan, target=(1, 191))
    assert (again.result, again.opaque_id) == (0, first.opaque_id)
    assert len(world.tasks()) == 1


def test_a_bad_item_is_refused_as_it_comes(world: World) -> None:
    before, after = "mission; GO; GO at=1.5,0", "GO at=1.5,1.5; GO at=0,1.5"
    for bad in """
DO_SET_MODE frame=2; : UNSUPPORTED
GO x=910000000 y=5; : INVALID_PARAM5_X
GO x=470000000 y=1810000000; : INVALID_PARAM6_Y
GO -1 at=1,0; : INVALID_PARAM1
GO 0 2000 at=1,0; : INVALID_PARAM2
GO at=1,0 frame=9; : UNSUPPORTED_FRAME
DO_JUMP 9 1 frame=2; : INVALID_PARAM1
TASK_STOP frame=2; : UNSUPPORTED
DO_CHANGE_SPEED 1 -7 frame=2; : INVALID_PARAM2
""".strip().split("\n"):
        check(world, f"{before}; {bad.replace(';', f'; {after}')} item 2: ")
    assert max(each.seq for each in world.client.of_type("MISSION_REQUEST")) == 2
    assert world.tasks() == ()


def test_a_refused_plan_leaves_the_one_before(world: World) -> None:
    uploaded(world)
    uploaded(world, HOME, Item(MODE))
    download = Download(world.client)
    world.until(lambda: download.is_done, within=5)
    assert (download.count, download.opaque_id) == (4, 1)
    assert world.state(1)[0] is S.BLOCKED


def test_two_wishes_to_start_are_one_and_later_it_is_another_task(world: World) -> None:
    uploaded(world, HOME, place(0.3, 0, hold=0.1))
    check(
        world,
        """
DO_SET_MODE 1 10 to=autopilot & wait 0.1 : ACCEPTED
MISSION_START to=autopilot & until 1 COMPLETED : ACCEPTED #1
wait 3 : -
MISSION_START to=autopilot & until 2 COMPLETED : ACCEPTED #2
""",
    )
    assert currents(world.client)[-1].mission_id == 2


def test_a_start_that_is_repeated_while_the_mission_waits_ends_nothing(world: World) -> None:
    """A copy of it, or the button again: somebody has disarmed the rover and paused its queue."""
    uploaded(world)
    check(
        world,
        """
person> ARM 0 & wait 1.5 : ACCEPTED
person> PAUSE & wait 1.5 : ACCEPTED
MISSION_START to=autopilot & wait 0.7 : ACCEPTED #1 / task 1: QUEUED NONE
MISSION_START to=autopilot & wait 5.2 : ACCEPTED #1 / task 1: QUEUED NONE
MISSION_START to=autopilot & wait 0.7 : ACCEPTED #1 / task 1: QUEUED NONE
ARM 1 & CONTINUE & until 1 COMPLETED within=60 : ACCEPTED+ACCEPTED
""",
        person=world.add_client("person"),
    )


@for_each("what, reason", [("TASK_STOP", R.STOPPED), ("operator disarms", R.DISARMED)])
def test_after_a_stop_or_while_it_may_not_be_armed_a_start_is_refused(
    world: World, what: str, reason: R
) -> None:
    uploaded(world)
    start(world)
    world.until_state(1, S.EXECUTING)
    ask(world, what)
    check(world, f"wait 4 : {'ACCEPTED' * (reason is R.STOPPED) or '-'}")
    check(world, f"MISSION_START to=autopilot : BUSY #{reason}")


@for_each("how", ["command", "message"])
def test_another_item_is_gone_on_with(world: World, how: str) -> None:
    uploaded(world)
    start(world)
    world.until_state(1, S.EXECUTING)
    if how == "command":
        check(world, "DO_SET_MISSION_CURRENT 3 to=autopilot & wait 0.1 : ACCEPTED #1")
    else:
        before = len(currents(world.client))
        world.client.send(set_current(3))
        world.run(0.05)
        assert currents(world.client)[before].seq == 3
    world.until_state(1, S.COMPLETED, within=60)
    assert reached(world.client) == [3]


def test_the_item_of_a_start_is_shown_at_once_and_an_earlier_one_after_that(world: World) -> None:
    uploaded(world, HOME, place(0.3, 0), place(0.3, 1))
    start(world)
    world.until_state(1, S.COMPLETED, within=30)
    world.run(3)
    world.client.send(set_current(2))
    start(world)
    world.until(lambda: currents(world.client)[-1].mission_id == 2, within=1)
    assert currents(world.client)[-1].seq == 2
    world.until_state(2, S.EXECUTING)
    world.client.send(set_current(1))
    assert world.shown(2).step == 0
    assert currents(world.client)[-1].seq == 1


def test_an_upload_ends_with_the_connection_of_its_client(world: World) -> None:
    world.client.send(common.MAVLink_mission_count_message(1, 1, 4, 0))
    world.run(0.1)
    other = world.add_client("other")
    end = PeerChanged(CLIENT_LINK, world.client.name, up=False)
    world.server.engine.handle(end, now=world.now)
    upload = Upload(other, PLAN)
    world.run(0.2)
    assert upload.result == 0


def test_clearing_takes_away_what_waits_and_not_what_is_driven(world: World) -> None:
    uploaded(world)
    check(
        world,
        f"""
mission_clear_all 0 : ACCEPTED task 1: CANCELLED CLEARED
MISSION_START to=autopilot : DENIED #{R.NOT_FOUND}
""",
    )
    uploaded(world)
    check(
        world,
        """
MISSION_START to=autopilot & until 2 EXECUTING : ACCEPTED
mission_clear_all 0 : DENIED
until 2 COMPLETED within=60 : -
""",
    )


def test_without_the_claim_missions_are_the_rovers_own(make_world: MakeWorld) -> None:
    world = make_world(settings=Settings(claim=False))
    check(world, "mission_clear_all 0 : ACCEPTED MISSION_ACK@1")
    assert world.tasks() == ()


def servo(number: int, pwm: float = 1500.0) -> Item:
    return Item(SERVO, param1=number, param2=pwm, frame=2)


def ordered(world: World, since: float = 0.0) -> list[float]:
    """Return param2 of the servo commands that went to the rover."""
    return [
        message.param2
        for at, message in world.observer.driven
        if getattr(message, "command", None) == SERVO and at > since
    ]


@for_each("what", ["TASK_STOP & wait 0.05", "operator disarms & wait 1.05"])
def test_nothing_more_is_ordered_after_a_stop_or_a_takeover(world: World, what: str) -> None:
    """A takeover shows with the rover's next heartbeat."""
    uploaded(world, HOME, place(1, 0), servo(5, 1100), servo(5, 1900), servo(6), place(6, 0))
    start(world)
    world.lose_acks()
    world.until(lambda: ordered(world), within=30)
    for each in what.split(" & "):
        ask(world, each)
    at_stop = world.now
    world.run(3)
    assert ordered(world, at_stop) == []


def test_a_start_while_it_is_being_cancelled_is_refused_and_then_it_is_another(
    world: World,
) -> None:
    uploaded(world)
    check(
        world,
        f"""
MISSION_START to=autopilot & until 1 EXECUTING : ACCEPTED
wait 2 & TASK_CANCEL 1 & MISSION_START to=autopilot : BUSY+ACCEPTED #{R.QUEUE_PAUSED}
until 1 CANCELLED : -
MISSION_START to=autopilot : ACCEPTED #2
""",
    )


@for_each("how", ["moving", "sticks"])
def test_nobody_is_taken_the_sticks_from_by_a_start(world: World, how: str) -> None:
    uploaded(world)
    check(world, "operator arms & operator manual & wait 1.5 : -")
    if how == "moving":
        world.rover.autopilot.operator_sticks(0.5, 0.0)
    else:
        world.add_client("pilot").stream(sticks(300), rate=10)
    world.run(1.5)
    at_start = world.now
    check(world, "MISSION_START to=autopilot & wait 0.2 : BUSY")
    assert world.observer.sent_since(at_start) in ([], ["MANUAL_CONTROL"])


@for_each("what", ["clear", "upload and clear", "empty upload", "fence"])
def test_what_is_not_stored_in_time_is_as_it_was(make_world: MakeWorld, what: str) -> None:
    store = LateStore(delay=0.0)
    world = make_world(store=store)
    uploaded(world)
    store.delay = 5.0
    if what == "upload and clear":
        Upload(world.client, PLAN)
        world.run(0.2)
    if "clear" in what:
        world.client.send(clear_all())
    elif what == "empty upload":
        Upload(world.client, ())
    else:
        yard = [Item(5003, **at(0, 0), param1=0.5, param4=0, frame=0)]
        Upload(world.client, yard, kind=1)
    world.run(3)
    store.delay = 0.0
    world.run(6)
    assert acks(world.client)[-1].result not in (0, None)
    assert start(world) == (ACCEPTED, 1)
    world.until_state(1, S.COMPLETED, within=60)


@for_each("clears", [True, False])
@for_each("delay, result", [(0.2, 0), (inf, 1)])
def test_the_end_of_the_mission_before_is_stored_before_the_ack(
    make_world: MakeWorld, delay: float, result: int, *, clears: bool
) -> None:
    store = LateStore()
    world = make_world(store=store)
    uploaded(world)
    store.delay = 0.2
    if clears:
        world.client.send(clear_all())
    else:
        Upload(world.client, PLAN)
    world.until(lambda: world.state(1)[0] is S.CANCELLED, within=1)
    store.delay = delay
    world.until(lambda: len(acks(world.client)) == 2, within=1)
    assert acks(world.client)[-1].result == result
    events, _ = store.left_by_a_crash()
    kept = {event.new for event in events if isinstance(event, TaskChanged)}
    assert (S.CANCELLED in kept) is (result == 0)


def test_a_clear_ends_also_a_paused_mission_that_was_replaced(world: World) -> None:
    uploaded(world)
    start(world)
    world.until_state(1, S.EXECUTING)
    uploaded(world)
    world.client.pause(target=(1, 1))
    world.until_state(1, S.PAUSED)
    world.client.send(clear_all())
    world.run(0.2)
    assert world.state(1) == (S.CANCELLED, R.REPLACED)


def test_a_start_is_acknowledged_once_it_is_stored(make_world: MakeWorld) -> None:
    store = LateStore(delay=0.0)
    world = make_world(store=store)
    uploaded(world)
    store.delay = 5.0
    refused = f"BUSY #{R.STORE_UNAVAILABLE} / task 1: BLOCKED"
    check(world, f"MISSION_START to=autopilot & wait 1 : {refused}")
    store.delay = 0.0
    check(world, "wait 6 : -\nMISSION_START to=autopilot : ACCEPTED #1")


@for_each("kind", [3, 77, 255])
def test_a_plan_of_a_strange_kind_is_refused(world: World, kind: int) -> None:
    upload = world.upload((), kind=kind)
    assert upload.result == 3
