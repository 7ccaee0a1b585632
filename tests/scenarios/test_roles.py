"""Who may do what: an observer, a submitter, an operator, and who is in charge of safety."""

from collections.abc import Callable, Mapping
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.settings import Limits, Roles, Settings
from mav_tasks.tasks.events import QueuePaused, SubmissionRefused, TaskChanged
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Mode
from tests.kit.cases import anew, for_each
from tests.kit.client import (
    ACCEPTED,
    AUTO,
    DENIED,
    DRIVE,
    GUIDED,
    HOLD,
    IDS,
    MANUAL,
    RTL,
    TEMPORARILY_REJECTED,
    FakeClient,
    Sent,
    set_mode,
    setpoint,
    sticks,
)
from tests.kit.mission import MISSION_ACK, Ack, Item, Upload
from tests.kit.world import World, at
from tests.scenarios.conftest import MakeWorld

CANCEL, CLEAR, MODIFY = 54010, 54011, 54012
PRIORITY, PREEMPTIVE, RUN_BEFORE = 1, 6, 11  # TASK_MODIFY, param2
CHANGE_SPEED, MISSION_START, SET_FENCE, REBOOT = 178, 300, 207, 246
WAYPOINT, RELAY, FENCE_CIRCLE = 16, 181, 5003
FENCE = 1  # MAV_MISSION_TYPE
MISSION_DENIED = 14  # MAV_MISSION_RESULT
OBSERVER, SUBMITTER, OTHER, OPERATOR = 9, 10, 11, 12  # system ids
#: of the client that every world has
ADDRESSES = {
    "9/190": "observer",
    "10/190": "submitter",
    "11/190": "submitter",
    "12/190": "operator",
}
NOT_ALLOWED = (DENIED, R.NOT_ALLOWED)

MakeRoles = Callable[..., World]


@anew
def with_roles(make_world: MakeWorld) -> MakeRoles:
    """Return a factory of worlds in which addresses have roles, with limits."""

    def make(*, guided: str = "queue", **limits: Limits) -> World:
        roles = Roles(unsigned="safety", addresses=ADDRESSES, **limits)
        return make_world(settings=Settings(roles=roles, guided=guided))

    return make


def join(world: World, system_id: int) -> FakeClient:
    client = world.add_client(f"client {system_id}", system_id=system_id)
    world.run(1.2)
    return client


def answer(world: World, sent: Sent) -> tuple[int, int] | None:
    world.run(0.2)
    return sent.answer


def active(world: World, distance: float, *, who: FakeClient | None = None) -> int:
    """Have a task driven; gives its id."""
    sent = (who or world.client).move(distance)
    assert answer(world, sent) == (ACCEPTED, sent.task_id)
    world.until_state(sent.task_id, S.EXECUTING)
    return sent.task_id


def upload(world: World, client: FakeClient, *items: Item, **kw: Any) -> int | None:
    sent = Upload(client, items or (Item(WAYPOINT, **place(2.0)),) * 2, **kw)
    world.run(2.0)
    return sent.result


def place(north: float) -> Mapping[str, Any]:
    found = at(north, 0.0)
    return {"x": found["x"], "y": found["y"]}


#: what an observer may not do
REFUSED: dict[str, Callable[[FakeClient], Sent]] = {
    "move": lambda c: c.move(1.0),
    "rotate": lambda c: c.rotate(10.0),
    "drive": lambda c: c.command(DRIVE, 0.3, 0, 1),
    "go to": lambda c: c.command_int(192, -1, 1, target=(1, 1), frame=6, **at(1.0, 0.0)),
    "go on": lambda c: c.proceed(),
    "cancel": lambda c: c.command(CANCEL, 1),
    "clear": lambda c: c.command(CLEAR),
    "modify": lambda c: c.command(MODIFY, 1, PRIORITY, 9),
    "speed": lambda c: c.command(CHANGE_SPEED, 1, 0.4),
    "guided": lambda c: c.mode(GUIDED),
    "manual": lambda c: c.mode(MANUAL),
    "return": lambda c: c.mode(RTL),
    "mission": lambda c: c.command(MISSION_START),
    "arm": lambda c: c.arm(),
    "relay": lambda c: c.command(RELAY, 0, 1, target=(1, 1)),
    "reboot": lambda c: c.command(REBOOT, 1, target=(1, 1)),
    "fence off": lambda c: c.command(SET_FENCE, 0, target=(1, 1)),
    "unknown": lambda c: c.command(31010, 1, target=(1, 1)),
}


def test_an_observer_changes_nothing(with_roles: MakeRoles) -> None:
    world = with_roles()
    task = active(world, 5.0)
    observer = join(world, OBSERVER)
    answers = {what: answer(world, ask(observer)) for what, ask in REFUSED.items()}
    assert answers == dict.fromkeys(REFUSED, NOT_ALLOWED)
    assert observer.said("role observer may not")
    assert [each.id for each in world.tasks()] == [task]
    assert world.state(task)[0] is S.EXECUTING
    world.until_state(task, S.COMPLETED)


def test_what_it_sends_without_an_answer_goes_nowhere(with_roles: MakeRoles) -> None:
    world = with_roles()
    observer = join(world, OBSERVER)
    towards = world.overheard(lambda source, _target, _data: source.startswith("server:vehicles"))
    mode = world.mode()
    for message in (
        set_mode(GUIDED),
        set_mode(AUTO),
        set_mode(RTL),
        setpoint(0.5),
        sticks(900),
        common.MAVLink_param_set_message(1, 1, b"CRUISE_SPEED", 5.0, 9),
        common.MAVLink_set_attitude_target_message(0, 1, 1, 0, [1, 0, 0, 0], 0, 0, 0, 0.5),
        common.MAVLink_file_transfer_protocol_message(0, 1, 1, [0, 0, 0, 6] + [0] * 247),
        common.MAVLink_v2_extension_message(0, 1, 1, 7, [0] * 249),
        common.MAVLink_system_time_message(1_800_000_000_000_000, 1),
        common.MAVLink_mission_item_int_message(1, 1, 0, 6, 16, 2, 1, 0, 0, 0, 0, 1, 1, 0, 0),
    ):
        observer.send(message)
        world.run(0.1)
    numbers = {data[7] | data[8] << 8 for data in towards}
    names = {name for name, number in IDS.items() if number in numbers}
    ours = {"HEARTBEAT", "TIMESYNC", "COMMAND_LONG", "COMMAND_INT", "MISSION_REQUEST_LIST"}
    assert names <= ours
    assert world.mode() is mode
    assert world.stands()


@for_each("who", [OBSERVER, SUBMITTER])
@for_each(
    "stop, state",
    [
        (lambda c: c.stop(), S.KILLED),
        (lambda c: c.stop(target=(0, 0)), S.KILLED),
        (lambda c: c.pause(), S.PAUSED),
        (lambda c: c.mode(HOLD), S.PAUSED),
        (lambda c: c.arm(False), S.PAUSED),
        (lambda c: c.send(set_mode(HOLD)), S.PAUSED),
    ],
)
def test_what_only_stops_a_rover_everybody_may(
    with_roles: MakeRoles, who: int, stop: Callable[[FakeClient], Any], state: S
) -> None:
    world = with_roles()
    task = world.client.move(20.0)
    somebody = join(world, who)
    world.until_state(task.task_id, S.EXECUTING)
    stop(somebody)
    world.until_state(task.task_id, state, within=2.0)
    world.until(world.stands, within=3.0)


def test_only_an_operator_releases_a_stop_which_is_kept_with_its_sender(
    with_roles: MakeRoles,
) -> None:
    world = with_roles()
    people = {number: join(world, number) for number in (OBSERVER, SUBMITTER, OPERATOR)}
    task = active(world, 20.0)
    assert answer(world, people[OBSERVER].stop()) == (ACCEPTED, task)
    assert world.paused() is R.STOPPED
    (pause,) = world.events(QueuePaused)
    (killed,) = [event for event in world.events(TaskChanged) if event.new is S.KILLED]
    assert pause.actor == killed.actor == "9/190@client 9"
    for number in (OBSERVER, SUBMITTER):
        assert answer(world, people[number].proceed()) == NOT_ALLOWED
    assert world.paused() is R.STOPPED
    assert answer(world, people[OPERATOR].proceed()) == (ACCEPTED, 0)
    assert world.paused() is R.NONE


def test_a_submitter_has_its_own_tasks_and_nobody_else_s(with_roles: MakeRoles) -> None:
    world = with_roles()
    submitter, other = join(world, SUBMITTER), join(world, OTHER)
    first = world.client.move(20.0)
    world.run(0.2)
    own, theirs = submitter.move(1.0), other.move(2.0)
    world.run(0.2)
    for task in (first.task_id, theirs.task_id, 0):
        assert answer(world, submitter.command(CANCEL, task)) == NOT_ALLOWED
    assert answer(world, submitter.command(MODIFY, theirs.task_id, PRIORITY, 1)) == NOT_ALLOWED
    assert answer(world, submitter.command(CLEAR)) == NOT_ALLOWED
    assert answer(world, submitter.proceed()) == NOT_ALLOWED
    assert answer(world, submitter.command(MODIFY, own.task_id, PREEMPTIVE, 1)) == NOT_ALLOWED
    assert "may not make a task pre-emptive; operator may" in " ".join(submitter.texts())
    modified = submitter.command(MODIFY, own.task_id, PRIORITY, 4)
    assert answer(world, modified) == (ACCEPTED, own.task_id)
    cancelled = submitter.command(CANCEL, own.task_id)
    assert answer(world, cancelled) == (ACCEPTED, own.task_id)
    operator = join(world, OPERATOR)
    for task in (theirs.task_id, first.task_id):
        assert answer(world, operator.command(CANCEL, task)) == (ACCEPTED, task)


def test_a_submitter_does_not_exceed_its_limits(with_roles: MakeRoles) -> None:
    limits = Limits(tasks=("move", "goto", "plan"), max_priority=6, max_speed=0.4, quota=2)
    world = with_roles(submitter=limits)
    submitter = join(world, SUBMITTER)
    world.client.pause()
    world.run(0.2)

    def refusal(sent: Sent) -> tuple[tuple[int, int] | None, str]:
        return answer(world, sent), submitter.texts()[-1]

    assert refusal(submitter.move(1.0, priority=7)) == (
        NOT_ALLOWED,
        "role submitter may use priority 6 at most, not 7",
    )
    assert refusal(submitter.rotate(10.0)) == (
        NOT_ALLOWED,
        "role submitter may not submit a rotate, only move, goto, plan",
    )
    assert refusal(submitter.move(1.0, speed=0.5)) == (
        NOT_ALLOWED,
        "role submitter may drive 0.4 m/s at most, not 0.5",
    )
    first = submitter.move(1.0, priority=6, speed=0.4)
    assert answer(world, first) == (ACCEPTED, first.task_id)
    raised = submitter.command(MODIFY, first.task_id, PRIORITY, 10)
    assert answer(world, raised) == NOT_ALLOWED
    second = submitter.move(1.1)
    world.run(0.2)
    assert refusal(submitter.move(1.2)) == (
        (TEMPORARILY_REJECTED, R.QUOTA),
        "role submitter may have at most 2 waiting tasks",
    )
    assert [task.id for task in world.tasks()] == [first.task_id, second.task_id]
    urgent = world.client.rotate(10.0, priority=9)
    assert answer(world, urgent) == (ACCEPTED, urgent.task_id)
    moved = submitter.command(MODIFY, first.task_id, RUN_BEFORE, urgent.task_id)
    assert answer(world, moved) == NOT_ALLOWED
    reasons = [event.reason for event in world.events(SubmissionRefused)]
    assert reasons.count(R.NOT_ALLOWED) == 5
    assert answer(world, world.client.rotate(10.0, priority=10)), "nobody else is bound by it"


def test_its_tasks_drive_no_faster_whoever_sets_the_speed(with_roles: MakeRoles) -> None:
    world = with_roles(submitter=Limits(max_speed=0.2))
    submitter, operator = join(world, SUBMITTER), join(world, OPERATOR)
    task = active(world, 2.0, who=submitter)
    operator.command(CHANGE_SPEED, 1, 1.5)
    fastest = 0.0

    def look(_now: float) -> None:
        nonlocal fastest
        fastest = max(fastest, world.truth.forward_speed)

    world.watch(look)
    world.until_state(task, S.COMPLETED)
    assert 0.15 < fastest < 0.25


def test_a_plan_is_bound_by_the_same_limits(with_roles: MakeRoles) -> None:
    world = with_roles(submitter=Limits(tasks=("goto",), max_speed=0.5))
    submitter = join(world, SUBMITTER)
    one = Item(WAYPOINT, **place(2.0))
    assert upload(world, submitter, one, target=(1, 191)) == 0
    assert upload(world, submitter, one, one, target=(1, 191)) != 0
    fast = Item(CHANGE_SPEED, param1=1, param2=0.9, param4=0.0, frame=2)
    assert upload(world, submitter, fast, one, target=(1, 191)) != 0
    relay = Item(RELAY, param1=0, param2=1, param4=0.0, frame=2)
    refused = Upload(submitter, (relay, one), target=(1, 191))
    world.run(2.0)
    assert (refused.result, refused.opaque_id) == (MISSION_DENIED, R.NOT_ALLOWED)
    assert submitter.said("contains rover commands")
    assert len(world.tasks()) == 1


def test_a_plan_is_started_and_replaced_by_its_owner_or_an_operator(with_roles: MakeRoles) -> None:
    world = with_roles()
    submitter, other = join(world, SUBMITTER), join(world, OTHER)
    operator = join(world, OPERATOR)
    assert upload(world, submitter, target=(1, 1)) == 0
    assert upload(world, other, target=(1, 1)) != 0
    assert answer(world, other.command(MISSION_START, target=(1, 1))) == NOT_ALLOWED
    assert answer(world, other.mode(AUTO)) == NOT_ALLOWED
    other.send(common.MAVLink_mission_clear_all_message(1, 1, 0))
    world.run(1.0)
    assert [Ack.of(p.payload).result for p in other.of_id(MISSION_ACK)][-1] == MISSION_DENIED
    assert upload(world, operator, target=(1, 1)) == 0
    assert answer(world, submitter.command(MISSION_START, target=(1, 1))) == NOT_ALLOWED
    started = operator.command(MISSION_START, target=(1, 1))
    assert answer(world, started) == (ACCEPTED, started.task_id)


@for_each("by", ["operator", "the rover's own switch"])
def test_a_submitter_does_not_end_driving_by_hand(with_roles: MakeRoles, by: str) -> None:
    world = with_roles()
    submitter, operator = join(world, SUBMITTER), join(world, OPERATOR)
    if by == "operator":
        operator.mode(MANUAL)
        world.run(1)
        operator.arm()
    else:
        world.operator_mode(Mode.MANUAL)
        world.operator_arm(True)
    world.run(2)
    submitter.move(1.0)
    upload(world, submitter, target=(1, 1))
    at = world.now
    assert answer(world, submitter.command(MISSION_START, target=(1, 1))) == NOT_ALLOWED
    assert "may not end manual control; operator may" in " ".join(submitter.texts())
    world.run(3)
    assert world.observer.sent_since(at) == []
    assert world.mode() is Mode.MANUAL


def test_what_bounds_a_rover_is_of_safety_alone(with_roles: MakeRoles) -> None:
    world = with_roles()
    operator = join(world, OPERATOR)
    before = world.rover.autopilot.parameters["CRUISE_SPEED"]
    fence = Item(FENCE_CIRCLE, **place(0.0), param1=50.0, param4=0.0)
    assert upload(world, operator, fence, target=(1, 1), kind=FENCE) != 0
    assert answer(world, operator.command(SET_FENCE, 0, target=(1, 1))) == NOT_ALLOWED
    for component, name in ((191, b"TSK_SPEED"), (1, b"CRUISE_SPEED")):
        operator.send(common.MAVLink_param_set_message(1, component, name, 1.5, 9))
    world.run(0.5)
    assert "role operator may not set parameters; safety may" in operator.texts()
    assert world.rover.autopilot.parameters["CRUISE_SPEED"] == before
    assert upload(world, world.client, fence, target=(1, 1), kind=FENCE) == 0
    world.client.send(common.MAVLink_param_set_message(1, 191, b"TSK_SPEED", 0.7, 9))
    world.run(0.5)
    assert world.server.engine.parameters == {"TSK_SPEED": pytest.approx(0.7)}


def test_to_run_at_once_is_for_operators(with_roles: MakeRoles) -> None:
    world = with_roles(guided="now")
    submitter, operator = join(world, SUBMITTER), join(world, OPERATOR)
    world.client.move(20.0)
    world.run(3.0)
    go = (-1, 1, 0, 0)
    sent = submitter.command_int(192, *go, target=(1, 1), frame=6, **at(1.0, 0.0))
    assert answer(world, sent) == NOT_ALLOWED
    sent = operator.command_int(192, *go, target=(1, 1), frame=6, **at(1.0, 0.0))
    assert answer(world, sent) == (ACCEPTED, sent.task_id)


def test_requests_that_are_too_many_are_refused_but_for_stop(with_roles: MakeRoles) -> None:
    world = with_roles(submitter=Limits(rate=2.0))
    submitter, other = join(world, SUBMITTER), join(world, OTHER)
    world.client.pause()
    world.run(2.0)
    sent = [submitter.command(MODIFY, 1, PRIORITY, 1) for _ in range(10)]
    world.run(0.05)
    submitter.acks.clear()
    late = submitter.move(1.0)
    assert answer(world, late) == (TEMPORARILY_REJECTED, R.RATE_LIMITED)
    assert "role submitter may send 2 requests per second" in submitter.texts()
    assert world.tasks() == ()
    assert len(sent) == 10
    assert answer(world, other.move(1.0)) is not None, "each client for itself"
    assert answer(world, submitter.stop()) is not None
    assert world.paused() is R.STOPPED
    world.run(1.0)
    assert answer(world, submitter.move(1.5)) is not None
