"""One rover, two ways to it: the server uses one at a time, and goes on by the other one."""

from typing import Any

from pymavlink.dialects.v20 import common

from mav_tasks.tasks.events import VehicleNoted, VehicleSeen
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.body import Pose
from rover_sim.personas import Mode
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, packed
from tests.kit.fleet import Fleet, Layout
from tests.kit.world import near_pose, twin_of
from tests.scenarios.conftest import MakeFleet

SETPOINT = 84
TWO_LINKS: Layout = {"one": {"a": (1,)}, "two": {"b": ()}}
ONE_LINK: Layout = {"one": {"a": (1,), "b": ()}}


def notes(fleet: Fleet) -> list[str]:
    return [note.text for note in fleet.events(VehicleNoted)]


def with_two(make: MakeFleet, layout: Layout = TWO_LINKS, **options: Any) -> Fleet:
    fleet = make(layout, second_radio=("a", "b"), **options)
    fleet.run(5)
    assert [each.text for each in fleet.events(VehicleSeen)][-1] == "is also heard at b"
    return fleet


def driven_at(fleet: Fleet, endpoint: str, since: float) -> list[float]:
    """Return the times at which set-points left for an endpoint."""
    sent = fleet.watched.towards.get(endpoint, [])
    return [at for at, data in sent if at >= since and data[7] == SETPOINT]


def silence(fleet: Fleet, *ways: str) -> None:
    """Lose everything at some endpoints, in both directions."""
    fleet.watched.loses = lambda source, target, _data: source in ways or target in ways


@for_each("layout", [TWO_LINKS, ONE_LINK])
def test_when_one_radio_dies_the_task_goes_on_by_the_other_within_a_second(
    make_fleet: MakeFleet, layout: Layout
) -> None:
    fleet = with_two(make_fleet, layout)
    fleet.client.move(6, target=(1, 191))
    fleet.until_state(1, S.EXECUTING)
    fleet.run(3)
    assert driven_at(fleet, "b", 0.0) == []  # one at a time
    at = fleet.now
    silence(fleet, "a")
    fleet.run(1)
    assert driven_at(fleet, "b", at)[0] - at < 1.0
    fleet.run(1)
    silence(fleet)
    since = fleet.now
    fleet.until_state(1, S.COMPLETED)
    assert driven_at(fleet, "a", since) == []
    assert near_pose(fleet.pose_of(1), (6.0, 0.0, 0.0))
    assert [state for state, _ in fleet.history(1)] == [S.STARTING, S.EXECUTING, S.COMPLETED]
    assert notes(fleet) == []


def test_answers_and_telemetry_come_once_and_stop_goes_by_the_living_radio(
    make_fleet: MakeFleet,
) -> None:
    fleet = with_two(make_fleet)
    for dead in ("", "a", "b"):
        silence(fleet, dead)
        fleet.run(3)
        before = len(fleet.client.acks)
        asked = fleet.client.arm(target=(1, 1))
        fleet.run(1)
        assert asked.answer == (ACCEPTED, 0)
        assert len(fleet.client.acks) - before == 1
    stamps = [position.time_boot_ms for position in fleet.client.of_type("LOCAL_POSITION_NED")]
    assert len(stamps) == len(set(stamps)) > 50
    fleet.client.move(9, target=(1, 191))
    fleet.run(4)
    silence(fleet, "a")  # a short while after "b" is back
    fleet.run(0.2)
    assert fleet.client.stop(target=(1, 191)) is not None
    fleet.run(4)
    assert fleet.rover.autopilot.mode is Mode.HOLD
    assert fleet.stands()
    assert fleet.queue_paused(1) is R.STOPPED


def test_a_radio_on_which_nothing_reaches_the_rover_is_left_too(make_fleet: MakeFleet) -> None:
    """It still brings all telemetry."""
    fleet = with_two(make_fleet)
    fleet.watched.loses = lambda _source, target, _data: target == "a"
    fleet.run(6)
    fleet.client.move(1, target=(1, 191))
    fleet.until_state(1, S.COMPLETED)
    assert near_pose(fleet.pose_of(1), (1.0, 0.0, 0.0))


@for_each("switched_on", ["later", "at the same time"])
def test_a_stranger_with_the_id_is_never_driven_whatever_it_says(
    make_fleet: MakeFleet, switched_on: str
) -> None:
    """It has the rover's unique id and another clock, or the same clock and another unique id."""
    fleet = make_fleet(TWO_LINKS)
    fleet.run(4)
    later = switched_on == "later"
    now = fleet.now if later else 0.0
    twin = twin_of(1, start=Pose(north=0.5), now=now, is_same=later)
    if not later:
        twin.handle_deadline(now=fleet.now)
    twin.autopilot.operator_arm(True, now=fleet.now)
    twin.autopilot.operator_mode(Mode.GUIDED, now=fleet.now)
    fleet.radios["b"].vehicles.append(twin)
    fleet.run(3)
    fleet.client.move(5, target=(1, 191))
    fleet.run(4)
    silence(fleet, "a")
    fleet.run(12)
    assert twin.truth.north == 0.5
    assert {data[7] for _, data in fleet.watched.towards["b"]} <= {0, 76, 111}
    assert notes(fleet)[0] == ("shares its id with a rover at b: ignored. Give that one another id")


def test_a_stranger_with_the_id_that_says_nothing_of_itself_is_not_followed(
    make_fleet: MakeFleet,
) -> None:
    fleet = make_fleet(TWO_LINKS)
    beat = common.MAVLink_heartbeat_message(10, 3, 1, 4, 4, 3)
    for second in range(12):
        if second == 4:
            silence(fleet, "a")
        fleet.net.send("b", fleet.links["two"].name, packed(beat, 1, 1))
        fleet.run(1)
    assert not [e.text for e in fleet.events(VehicleSeen) if "is now at" in e.text]


def test_an_echo_of_the_servers_own_packets_stops_nothing_and_is_told(
    make_fleet: MakeFleet,
) -> None:
    """A router in a loop; a second controller with the server's address still counts."""
    fleet = make_fleet({"one": {"a": (1,)}})
    fleet.observers.clear()  # which take the echo for a second controller
    carry = type(fleet.watched).send

    def loses(source: str, target: str, data: bytes) -> bool:
        if target == "a":
            carry(fleet.watched, "a", source, data)
        return False

    fleet.watched.loses = loses
    fleet.client.move(3, target=(1, 191))
    fleet.until_state(1, S.COMPLETED)
    assert near_pose(fleet.pose_of(1), (3.0, 0.0, 0.0))
    (note,) = notes(fleet)
    assert note == (
        "sends the server's own packets back on server:one. Look for a router on this link that"
        " is in a loop, or an adapter that hears itself"
    )
    fleet.client.move(3, target=(1, 191))
    fleet.run(3)
    other = common.MAVLink(None, 250, 191)
    words = common.MAVLink_set_position_target_local_ned_message(
        1, 1, 1, 8, 0x5C7, 0, 0, 0, 0.5, 0, 0, 0, 0, 0, 0, 0
    )
    fleet.net.send("a", "server:one", words.pack(other))
    fleet.run(1)
    assert fleet.state(2) == (S.PAUSED, R.TAKEOVER)
    assert notes(fleet)[1] == "also controlled by 250/191"
