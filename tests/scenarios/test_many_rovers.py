"""Many rovers on many links: each has its own tasks, what befalls one is no other's business."""

from collections.abc import Callable
from functools import cache, partial
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import common

from mav_tasks.links.memory import Conditions
from mav_tasks.tasks.events import TaskChanged, VehicleNoted
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.body import Pose
from rover_sim.faults import Faults
from rover_sim.personas import Mode
from rover_sim.vehicle import Vehicle
from tests.kit.cases import for_each
from tests.kit.client import (
    ACCEPTED,
    DENIED,
    GUIDED,
    TASK_STATUS,
    TEMPORARILY_REJECTED,
    Sent,
    TaskStatus,
    packed,
    setpoint,
)
from tests.kit.fleet import Fleet, Layout
from tests.kit.world import near_pose, twin_of
from tests.scenarios.conftest import MakeFleet

CANCEL, CLEAR, MODIFY = 54010, 54011, 54012
PRIORITY = 1
HEARTBEAT, COMMAND, TIMESYNC = 0, 76, 111
QUEUE_STATUS, FLAGS = 54001, 77  # TASK_QUEUE_STATUS, and the byte of its flags
OFF = Faults(silent=True, deaf=True)
GOOD = Conditions()
BRAKING = 3.5  # s, from the speeds driven here to a stand
SERVER = (250, 191)  # on the vehicle links


FIVE: Layout = {"own": {"a": (1,)}, "shared": {"b": (2,), "c": (3,)}, "radio": {"d": (4, 5)}}
TWO: Layout = {"one": {"a": (1,)}, "two": {"b": (2,)}}


class Diary(NamedTuple):
    """All that was done with one rover, and when: two of them can be compared."""

    journal: list[object]
    driven: list[tuple[float, str, dict[str, Any]]]


def diary_of(fleet: Fleet, number: int) -> Diary:
    """Return what the journal has of a rover, and every setpoint and command that left for it."""
    driven = [(at, m.get_type(), m.to_dict()) for at, m in fleet.observers[number - 1].driven]
    return Diary(fleet.journal_of(number), driven)


# each rover its own tasks


def test_commands_that_two_clients_have_for_two_rovers_at_once_are_answered_by_the_right_one(
    make_fleet: MakeFleet,
) -> None:
    fleet = make_fleet(FIVE)
    fleet.break_rover(4, OFF)  # behind the same radio as 5
    for number in (4, 5):
        fleet.client.arm(target=(number, 1))
    fleet.other.arm(target=(2, 1))
    fleet.run(0.05)
    answers = [(a.get_srcSystem(), a.result) for a in fleet.client.acks]
    assert answers == [(5, ACCEPTED)]  # it does not wait for the other one's answer
    fleet.run(0.5)
    answers = [(a.get_srcSystem(), a.result) for a in fleet.client.acks]
    assert answers == [(5, ACCEPTED), (4, TEMPORARILY_REJECTED)]
    assert [(a.get_srcSystem(), a.result) for a in fleet.other.acks] == [(2, ACCEPTED)]
    assert [v.autopilot.armed for v in fleet.rovers] == [False, True, False, False, True]


# one rover in trouble changes nothing for another


def take_link_down(fleet: Fleet) -> None:
    fleet.observer.expects_gaps = True
    fleet.link_down("one")


#: what befalls the first rover, and how many seconds after the first command
TROUBLES: dict[str, tuple[float, Callable[[Fleet], None]]] = {
    "falls silent": (2.0, lambda fleet: fleet.break_rover(1, OFF)),
    "refuses modes": (0.0, lambda fleet: fleet.break_rover(1, Faults(refuse_mode=True))),
    "refuses to arm": (0.0, lambda fleet: fleet.break_rover(1, Faults(refuse_arm=True))),
    "answers late": (0.0, lambda fleet: fleet.watched.late.update({1: 1.5})),
    "becomes late": (2.0, lambda fleet: fleet.watched.late.update({1: 1.5})),
    "loses its link": (2.0, take_link_down),
}
PLACES: dict[str, Layout] = {
    "another link": TWO,
    "the same link": {"one": {"a": (1,), "b": (2,)}},
    "the same radio": {"one": {"r": (1, 2)}},
}


class Lived(NamedTuple):
    """What became of two rovers, the first of them in trouble or not."""

    first: Diary
    second: Diary
    #: (result, result_param2) and its time, of each command for the second
    answers: list[tuple[tuple[int, int] | None, float]]
    pose: tuple[float, float, float]


def live(where: str, trouble: str | None, conditions: Conditions = GOOD, seed: int = 0) -> Lived:
    """Let two rovers live ten seconds; all that a client asks is asked at fixed times."""
    fleet = Fleet(PLACES[where], seed=seed, conditions=conditions)
    fleet.ready()
    a, b = fleet.client, fleet.other
    script: list[tuple[float, Callable[[], Sent | None]]] = [
        (0.0, lambda: a.move(2.0, target=(1, 191))),
        (0.1, lambda: b.move(1.5, speed=0.8, target=(2, 191))),
        (2.5, lambda: a.rotate(90, target=(1, 191))),
        (2.6, lambda: b.rotate(-120, target=(2, 191))),
        (3.0, lambda: b.pause(target=(2, 191))),
        (4.5, lambda: b.proceed(target=(2, 191))),
        (4.7, lambda: b.move(3, target=(2, 191))),
        (8.0, lambda: b.command(CANCEL, 0, target=(2, 191))),
    ]
    if trouble is not None:
        at, begin = TROUBLES[trouble]
        script.insert(0, (at, partial(begin, fleet)))
    began = fleet.now
    answers = []
    for at, act in sorted(script, key=lambda step: step[0]):
        fleet.run(began + at - fleet.now)
        sent = act()
        if sent is not None and sent.message.target_system == 2:
            answers.append(sent)
    fleet.run(began + 10.0 - fleet.now)
    fleet.check()
    return Lived(
        diary_of(fleet, 1),
        diary_of(fleet, 2),
        [(sent.answer, sent.acked_at) for sent in answers],
        fleet.pose_of(2),
    )


@cache
def in_peace(where: str, conditions: Conditions = GOOD, seed: int = 0) -> Lived:
    """Live without any trouble."""
    lived = live(where, None, conditions, seed)
    changes = [e for e in lived.second.journal if isinstance(e, TaskChanged)]
    assert {S.PAUSED, S.COMPLETED, S.CANCELLED} <= {change.new for change in changes}
    assert len(lived.second.driven) > 150
    return lived


TROUBLED = [
    *(("another link", trouble) for trouble in TROUBLES),
    ("the same link", "becomes late"),
    ("the same radio", "falls silent"),
]


@for_each("where, trouble", TROUBLED)
def test_what_befalls_one_rover_changes_nothing_for_another(where: str, trouble: str) -> None:
    """To the last bit and the same moment: each vehicle ticks in a rhythm of its own.

    Task ids are the same as well, because both clients' submissions are accepted in every case.
    """
    peace, lived = in_peace(where), live(where, trouble)
    assert lived.second.journal == peace.second.journal
    assert lived.second.driven == peace.second.driven
    assert lived.answers == peace.answers
    assert lived.pose == peace.pose
    assert lived.first.journal != peace.first.journal


def test_a_second_controller_on_one_link_takes_only_the_rovers_of_that_link(
    make_fleet: MakeFleet,
) -> None:
    fleet = make_fleet(FIVE)
    drive_all(fleet)
    fleet.watched.observers_at["stranger"] = tuple(fleet.observers[1:3])
    heartbeat = common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    fleet.net.send("stranger", "server:shared", packed(heartbeat, *SERVER))
    fleet.run(1)
    states = [fleet.tasks_of(number)[0].state for number in range(1, 6)]
    assert states == [S.EXECUTING, S.PAUSED, S.PAUSED, S.EXECUTING, S.EXECUTING]
    assert [fleet.queue_paused(n) for n in (2, 3)] == [R.TAKEOVER, R.TAKEOVER]


# What is for system 0 is heard by all behind an endpoint, so that all of them must be allowed it.
@for_each("other", ["drives", "is stopped", "is not armed"])
def test_a_setpoint_for_all_does_not_reach_who_may_not_have_it_behind_the_same_radio(
    other: str,
) -> None:
    fleet = Fleet({"radio": {"r": (1, 2)}})  # checked here, where the mark sees it
    fleet.ready()
    fleet.rover.autopilot.operator_mode(Mode.HOLD, now=fleet.now)
    fleet.rover.autopilot.operator_arm(True, now=fleet.now)
    fleet.run(0.5)
    fleet.client.mode(GUIDED, target=(1, 1))
    fleet.run(0.5)
    if other == "drives":
        fleet.other.move(5, target=(2, 191))
        fleet.run(1)
    elif other == "is stopped":
        fleet.other.stop(target=(2, 191))
        fleet.run(1)
    fleet.client.stream(setpoint(0.5, 0.3, system=0), rate=10)
    fleet.run(1)
    fleet.client.end_streams()
    fleet.client.stream(setpoint(0.5, 0.3, system=1), rate=10)
    fleet.run(1)
    assert not fleet.stands(1)  # what is for it alone passes all the same
    fleet.check()


# STOP


def drive_all(fleet: Fleet) -> None:
    """Have every rover drive a task of its own."""
    for number in range(1, len(fleet.rovers) + 1):
        fleet.client.move(20, speed=1.0, target=(number, 191))
    fleet.run(2.5)
    assert not any(fleet.stands(number) for number in range(1, len(fleet.rovers) + 1))


def stands_in_hold(fleet: Fleet, number: int) -> bool:
    rover, control = fleet.rovers[number - 1], fleet.seen(number).control
    return fleet.stands(number) and rover.autopilot.mode is Mode.HOLD and control == "IDLE"


def test_stop_for_all_reaches_every_link_in_one_step_and_is_latched_for_each(
    make_fleet: MakeFleet,
) -> None:
    fleet = make_fleet(FIVE)
    drive_all(fleet)
    at = fleet.now
    stop = fleet.other.stop(target=(0, 0))
    fleet.run(0.0015)  # the way to the server, and not a tick more
    holds = [[t for t, _ in o.driven if t > at] for o in fleet.observers]
    assert [fleet.sent_to(n, holds[n - 1][0]) for n in range(1, 6)] == [["HOLD", "zero"]] * 5
    assert len({t for times in holds for t in times}) == 1
    fleet.until(lambda: all(stands_in_hold(fleet, n) for n in range(1, 6)), within=BRAKING)
    assert stop.answer == (ACCEPTED, 1)
    assert len(fleet.other.acks) == 1
    assert {t.state for t in fleet.tasks()} == {S.KILLED}
    assert {fleet.queue_paused(n) for n in range(1, 6)} == {R.STOPPED}


# places


TWINS: dict[str, Layout] = {
    "another link": {"one": {"a": (1,)}, "two": {"b": (2,), "twin": ()}},
    "the same link": {"one": {"a": (1,), "twin": ()}, "two": {"b": (2,)}},
}


def beside_a_twin(where: str, *, is_there: bool) -> tuple[Fleet, Vehicle]:
    fleet = Fleet(TWINS[where])
    fleet.ready()
    twin = twin_of(1, start=Pose(north=50.0, east=5.0), now=fleet.now)
    fleet.client.move(1, target=(1, 191))
    fleet.client.move(2, target=(2, 191))
    fleet.run(1.0)
    if is_there:  # as bad as can be: it would follow the first setpoint that reaches it
        fleet.radios["twin"].vehicles.append(twin)
        twin.autopilot.operator_arm(True, now=fleet.now)
        twin.autopilot.operator_mode(Mode.GUIDED, now=fleet.now)
    fleet.run(1.5)
    fleet.client.rotate(45, target=(1, 191))
    fleet.run(7.0)
    fleet.check()
    return fleet, twin


@for_each("where", TWINS)
def test_a_second_vehicle_of_one_id_is_noted_and_never_driven_and_the_first_goes_on(
    where: str,
) -> None:
    alone, _ = beside_a_twin(where, is_there=False)
    fleet, twin = beside_a_twin(where, is_there=True)
    notes = [e.text for e in fleet.events(VehicleNoted)]
    assert notes == ["shares its id with a rover at twin: ignored. Give that one another id"]
    assert fleet.client.said("shares its id with a rover")
    fleet.client.command(512, QUEUE_STATUS, target=(1, 191))
    fleet.run(0.2)
    *_, status = fleet.client.of_id(QUEUE_STATUS)
    assert status.payload[FLAGS] == 1  # each client that asks later is told, too
    assert (twin.truth.north, twin.truth.east) == (50.0, 5.0)
    asked = {HEARTBEAT, TIMESYNC, COMMAND}  # which vehicle it is
    assert {data[7] for _, data in fleet.watched.towards["twin"]} == asked
    assert max(m.x for m in fleet.client.of_type("LOCAL_POSITION_NED")) < 3.0

    mine, before = diary_of(fleet, 1), diary_of(alone, 1)
    assert mine.driven == before.driven
    assert [e for e in mine.journal if not isinstance(e, VehicleNoted)] == before.journal
    assert diary_of(fleet, 2) == diary_of(alone, 2)
    assert near_pose(fleet.pose_of(1), (1.0, 0.0, 45.0))


MOVABLE: Layout = {"one": {"a": (1,), "b": (2,)}, "two": {"c": (3,), "new": ()}}


@for_each("silence", [0.0, 4.0])
def test_a_rover_that_comes_back_on_another_link_is_driven_there_and_no_more_at_the_old_place(
    make_fleet: MakeFleet, silence: float
) -> None:
    """With a short silence it is another of its id at first: one that may be both is not driven."""
    fleet = make_fleet(MOVABLE)
    fleet.client.move(4, target=(1, 191))
    fleet.client.move(4, target=(2, 191))
    fleet.run(1.5)
    fleet.break_rover(1, OFF)
    fleet.run(silence)
    fleet.moves_house(1, source="a", target="new")
    fleet.break_rover(1, Faults())
    since = fleet.now
    fleet.until(lambda: fleet.work_at("new", since), within=6)
    moved_at = fleet.work_at("new", since)[0]
    fleet.until_state(1, S.EXECUTING)
    emergency_stop_packets = (
        fleet.server.engine.emergency_stop_packets
    )  # what is sent when the server itself fails
    fleet.until_state(1, S.COMPLETED)

    assert near_pose(fleet.pose_of(1), (4.0, 0.0, 0.0))
    assert (S.PAUSED, R.POSITION_LOST) in fleet.history(1)
    assert fleet.work_at("a", moved_at) == []
    assert {word.peer for word in emergency_stop_packets} == {"new", "b"}
    asked = fleet.other.arm(False, target=(1, 1))  # what a client has for it goes there, too
    fleet.run(0.1)
    assert asked.answer == (ACCEPTED, 0)
    assert fleet.state(2)[0] is S.COMPLETED


# what is shown


def test_a_task_of_another_rover_is_not_touched_and_never_shown_as_ones_own(
    make_fleet: MakeFleet,
) -> None:
    fleet = make_fleet({"radio": {"r": (1, 2)}})
    for number in (1, 2):
        for metres in (9, 8):
            fleet.client.move(metres, target=(number, 191))
    fleet.run(1)
    foreign = fleet.tasks_of(2)[1]
    asked = [
        fleet.client.command(CANCEL, foreign.id, target=(1, 191)),
        fleet.client.command(MODIFY, foreign.id, PRIORITY, 1, target=(1, 191)),
    ]
    fleet.client.request_status(foreign.id, target=(1, 191))
    cleared = fleet.client.command(CLEAR, 1, target=(1, 191))
    fleet.run(2)
    assert [sent.answer for sent in asked] == [(DENIED, R.NOT_FOUND)] * 2
    statuses = [(p.source, TaskStatus.of(p.payload)) for p in fleet.client.of_id(TASK_STATUS)]
    assert {source for source, s in statuses if s.task_id == foreign.id} <= {(2, 191)}
    assert cleared.result == ACCEPTED
    assert {t.state for t in fleet.tasks_of(1)} == {S.CANCELLED}
    assert [t.state for t in fleet.tasks_of(2)] == [S.EXECUTING, S.QUEUED]
    assert fleet.task(foreign.id) == foreign
