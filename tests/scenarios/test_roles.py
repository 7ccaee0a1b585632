"""Who may do what: an observer, a submitter, an operator, and who is in charge of safety."""

from collections.abc import Callable

import pytest

from mav_tasks.config.settings import Limits, Roles, Settings
from mav_tasks.tasks.events import QueuePaused, SubmissionRefused, TaskChanged
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Mode
from tests.kit.cases import anew, for_each
from tests.kit.client import (
    ACCEPTED,
    IDS,
    MANUAL,
    TEMPORARILY_REJECTED,
    FakeClient,
    Sent,
)
from tests.kit.rows import SHORT, ask, check
from tests.kit.world import World, put_home
from tests.scenarios.conftest import MakeWorld

MODIFY, PRIORITY, CHANGE_SPEED, RELEASE = 54012, 1, 178, 54013
OBSERVER, SUBMITTER, OTHER, OPERATOR = 9, 10, 11, 12  # system ids
PEOPLE = {"submitter": SUBMITTER, "other": OTHER, "operator": OPERATOR}
ZEROS = SHORT["ZEROS"]
#: of the client that every world has
ADDRESSES = {
    "9/190": "observer",
    "10/190": "submitter",
    "11/190": "submitter",
    "12/190": "operator",
}
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


def test_an_observer_changes_nothing(with_roles: MakeRoles) -> None:
    world = with_roles()
    task = active(world, 12.0)
    check(
        world,
        """
observer> TASK_MOVE 1 : NOT_ALLOWED / role observer may not
observer> TASK_ROTATE 10 : NOT_ALLOWED
observer> TASK_DRIVE 0.3 0 1 : NOT_ALLOWED
observer> DO_REPOSITION -1 1 to=autopilot frame=6 at=1,0 : NOT_ALLOWED
observer> DO_PAUSE_CONTINUE 1 : NOT_ALLOWED
observer> TASK_CANCEL 1 : NOT_ALLOWED
observer> TASK_CLEAR : NOT_ALLOWED
observer> TASK_MODIFY 1 1 9 : NOT_ALLOWED
observer> DO_CHANGE_SPEED 1 0.4 : NOT_ALLOWED
observer> DO_SET_MODE 1 15 to=autopilot : NOT_ALLOWED
observer> DO_SET_MODE 1 0 to=autopilot : NOT_ALLOWED
observer> DO_SET_MODE 1 11 to=autopilot : NOT_ALLOWED
observer> MISSION_START : NOT_ALLOWED
observer> ARM 1 : NOT_ALLOWED
observer> DO_SET_RELAY 0 1 to=autopilot : NOT_ALLOWED
observer> PREFLIGHT_REBOOT_SHUTDOWN 1 to=autopilot : NOT_ALLOWED
observer> DO_FENCE_ENABLE 0 to=autopilot : NOT_ALLOWED
observer> USER_1 1 to=autopilot : NOT_ALLOWED
""",
        observer=join(world, OBSERVER),
    )
    assert [each.id for each in world.tasks()] == [task]
    assert world.state(task)[0] is S.EXECUTING
    world.until_state(task, S.COMPLETED)


#: what has no answer
UNANSWERED = f"""client:set_mode 1 1 15
client:set_mode 1 1 10
client:set_mode 1 1 11
client:set_position_target_local_ned 0 1 1 8 1479 0 0 0 0.5 0 0 0 0 0 0 0
client:manual_control 1 900 0 0 0 0
client:param_set 1 1 CRUISE_SPEED 5.0 9
client:set_attitude_target 0 1 1 0 1,0,0,0 0 0 0 0.5
client:file_transfer_protocol 0 1 1 0,0,0,6,{ZEROS}
client:v2_extension 0 1 1 7 0,0,{ZEROS}
client:system_time 1800000000000000 1
client:mission_item_int 1 1 0 6 16 2 1 0 0 0 0 1 1 0 0"""


def test_what_it_sends_without_an_answer_goes_nowhere(with_roles: MakeRoles) -> None:
    world = with_roles()
    observer = join(world, OBSERVER)
    towards = world.overheard(lambda source, _target, _data: source.startswith("server:vehicles"))
    mode = world.mode()
    for message in UNANSWERED.splitlines():
        ask(world, message, observer)
        world.run(0.1)
    numbers = {data[7] | data[8] << 8 for data in towards}
    names = {name for name, number in IDS.items() if number in numbers}
    ours = {"HEARTBEAT", "TIMESYNC", "COMMAND_LONG", "COMMAND_INT", "MISSION_REQUEST_LIST"}
    assert names <= ours
    assert world.mode() is mode
    assert world.stands()


STOPS = """TASK_STOP : KILLED
TASK_STOP to=all : KILLED
DO_PAUSE_CONTINUE 0 : PAUSED
DO_SET_MODE 1 4 to=autopilot : PAUSED
COMPONENT_ARM_DISARM 0 to=autopilot : PAUSED
client:set_mode 1 1 4 : PAUSED"""


@for_each("who", [OBSERVER, SUBMITTER])
@for_each("stop", STOPS.splitlines())
def test_what_only_stops_a_rover_everybody_may(with_roles: MakeRoles, who: int, stop: str) -> None:
    world = with_roles()
    task = world.client.move(20.0)
    somebody = join(world, who)
    world.until_state(task.task_id, S.EXECUTING)
    request, _, state = stop.partition(" : ")
    ask(world, request, somebody)
    world.until_state(task.task_id, S[state], within=2.0)
    world.until(world.stands, within=3.0)


def test_only_an_operator_releases_a_stop_which_is_kept_with_its_sender(
    with_roles: MakeRoles,
) -> None:
    world = with_roles()
    people = {name: join(world, number) for name, number in PEOPLE.items()}
    active(world, 20.0)
    check(
        world,
        """
observer> TASK_STOP : ACCEPTED #1 / queue STOPPED
observer> CONTINUE : NOT_ALLOWED
submitter> CONTINUE : NOT_ALLOWED / queue STOPPED
operator> CONTINUE : ACCEPTED #0 / queue NONE
""",
        observer=join(world, OBSERVER),
        **people,
    )
    (pause,) = world.events(QueuePaused)
    (killed,) = [event for event in world.events(TaskChanged) if event.new is S.KILLED]
    assert pause.actor == killed.actor == "9/190@client 9"


def test_a_submitter_has_its_own_tasks_and_nobody_else_s(with_roles: MakeRoles) -> None:
    world = with_roles()
    people = {name: join(world, number) for name, number in PEOPLE.items()}
    check(
        world,
        """
TASK_MOVE 20 : ACCEPTED #1
submitter> TASK_MOVE 1 : ACCEPTED #2
other> TASK_MOVE 2 : ACCEPTED #3
submitter> TASK_CANCEL 1 : NOT_ALLOWED
submitter> TASK_CANCEL 3 : NOT_ALLOWED
submitter> TASK_CANCEL 0 : NOT_ALLOWED
submitter> TASK_MODIFY 3 1 1 : NOT_ALLOWED
submitter> TASK_CLEAR : NOT_ALLOWED
submitter> DO_PAUSE_CONTINUE 1 : NOT_ALLOWED
submitter> TASK_MODIFY 2 6 1 : NOT_ALLOWED / may not make a task pre-emptive; operator may
submitter> TASK_MODIFY 2 1 4 : ACCEPTED #2
submitter> TASK_CANCEL 2 : ACCEPTED #2
operator> TASK_CANCEL 3 : ACCEPTED #3
operator> TASK_CANCEL 1 : ACCEPTED #1
""",
        **people,
    )


def test_a_submitter_does_not_exceed_its_limits(with_roles: MakeRoles) -> None:
    limits = Limits(tasks=("move", "goto", "plan"), max_priority=6, max_speed=0.4, quota=2)
    world = with_roles(submitter=limits)
    check(
        world,
        """
DO_PAUSE_CONTINUE 0 : ACCEPTED
submitter> TASK_MOVE 1 0 0 0 0 0 7 : NOT_ALLOWED / role submitter may use priority 6 at most, not 7
submitter> TASK_ROTATE 10 : NOT_ALLOWED / may not submit a rotate, only move, goto, plan
submitter> TASK_MOVE 1 0.5 : NOT_ALLOWED / role submitter may drive 0.4 m/s at most, not 0.5
submitter> TASK_MOVE 1 0.4 0 0 0 0 6 : ACCEPTED #1
submitter> TASK_MODIFY 1 1 10 : NOT_ALLOWED
submitter> TASK_MOVE 1.1 : ACCEPTED #2
submitter> TASK_MOVE 1.2 : BUSY #101 / role submitter may have at most 2 waiting tasks
TASK_ROTATE 10 0 0 0 0 0 9 : ACCEPTED #3
submitter> TASK_MODIFY 1 11 3 : NOT_ALLOWED
""",
        submitter=join(world, SUBMITTER),
    )
    assert [task.id for task in world.tasks()] == [1, 2, 3]
    reasons = [event.reason for event in world.events(SubmissionRefused)]
    assert reasons.count(R.NOT_ALLOWED) == 5
    check(world, "TASK_ROTATE 10 0 0 0 0 0 10 : ACCEPTED #4")  # nobody else is bound by it


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
    check(
        world,
        """
submitter> plan; TO : ACCEPTED
submitter> plan; TO; TO : DENIED
submitter> plan; DO_CHANGE_SPEED 1 0.9 0 0 frame=2; TO : DENIED
submitter> plan; DO_SET_RELAY 0 1 0 0 frame=2; TO : DENIED #108 / contains rover commands
""".replace("TO", "NAV_WAYPOINT at=2,0"),
        submitter=join(world, SUBMITTER),
    )
    assert len(world.tasks()) == 1


def test_a_plan_is_started_and_replaced_by_its_owner_or_an_operator(with_roles: MakeRoles) -> None:
    world = with_roles()
    people = {name: join(world, number) for name, number in PEOPLE.items()}
    check(
        world,
        """
submitter> mission; TO; TO : ACCEPTED
other> mission; TO; TO : DENIED
other> MISSION_START to=autopilot : NOT_ALLOWED
other> DO_SET_MODE 1 10 to=autopilot : NOT_ALLOWED
other> client:mission_clear_all 1 1 0 : DENIED
operator> mission; TO; TO : ACCEPTED
submitter> MISSION_START to=autopilot : NOT_ALLOWED
operator> MISSION_START to=autopilot : ACCEPTED #2
""".replace("TO", "NAV_WAYPOINT at=2,0"),
        **people,
    )


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
    ask(world, "mission; NAV_WAYPOINT at=2,0; NAV_WAYPOINT at=2,0", submitter)
    world.run(2)
    at = world.now
    refused = (
        "> MISSION_START to=autopilot : NOT_ALLOWED / may not end manual control; operator may"
    )
    check(world, f"submitter{refused}", submitter=submitter)
    world.run(3)
    assert world.observer.sent_since(at) == []
    assert world.mode() is Mode.MANUAL


@for_each("how", ["MISSION_START to=autopilot", "DO_SET_MODE 1 10 to=autopilot"])
@for_each("has_it", ["a person", "a held task"])
def test_a_submitters_mission_takes_the_rover_from_nobody(
    with_roles: MakeRoles, how: str, has_it: str
) -> None:
    world = with_roles()
    submitter = join(world, SUBMITTER)
    ask(world, "mission; NAV_WAYPOINT at=0,0; NAV_WAYPOINT at=9,9", submitter)
    world.run(1)
    if has_it == "a person":
        put_home(world, -20, 0)
        world.operator_mode(Mode.HOLD)
        world.operator_arm(True)
        world.operator_mode(Mode.RTL)
    else:
        world.observer.expects_gaps = True
        active(world, 5.0)
        world.suspend_server(3.0)
    world.run(4)
    at = world.now
    check(world, f"submitter> {how} : ACCEPTED #1", submitter=submitter)
    world.run(4)
    assert world.state(1)[0] is S.QUEUED
    assert (world.paused(), "move" in world.observer.sent_since(at)) == (R.NONE, False)
    if has_it == "a person":
        assert world.mode() is Mode.RTL
        world.operator_mode(Mode.HOLD)
        world.run(3)
        world.client.proceed()
    else:
        world.client.command(RELEASE, 2, 2)
    world.until_state(1, S.EXECUTING)


def test_what_bounds_a_rover_is_of_safety_alone(with_roles: MakeRoles) -> None:
    world = with_roles()
    before = world.rover.autopilot.parameters["CRUISE_SPEED"]
    check(
        world,
        """
operator> fence; NAV_FENCE_CIRCLE_INCLUSION 50 0 0 0 at=0,0 : DENIED
operator> DO_FENCE_ENABLE 0 to=autopilot : NOT_ALLOWED
operator> client:param_set 1 191 TSK_SPEED 1.5 9 : - role operator may not set parameters; safety
operator> client:param_set 1 1 CRUISE_SPEED 1.5 9 : -
fence; NAV_FENCE_CIRCLE_INCLUSION 50 0 0 0 at=0,0 : ACCEPTED
client:param_set 1 191 TSK_SPEED 0.7 9 : -
""",
        operator=join(world, OPERATOR),
    )
    assert world.rover.autopilot.parameters["CRUISE_SPEED"] == before
    assert world.server.engine.parameters == {"TSK_SPEED": pytest.approx(0.7)}


def test_to_run_at_once_is_for_operators(with_roles: MakeRoles) -> None:
    world = with_roles(guided="now")
    people = {name: join(world, number) for name, number in PEOPLE.items()}
    check(
        world,
        """
TASK_MOVE 20 : ACCEPTED
wait 3 : -
submitter> DO_REPOSITION -1 1 0 0 to=autopilot frame=6 at=1,0 : NOT_ALLOWED
operator> DO_REPOSITION -1 1 0 0 to=autopilot frame=6 at=1,0 : ACCEPTED #2
""",
        **people,
    )


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
