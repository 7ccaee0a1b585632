"""Faults by the clock: how they are written, and what is said of what is not understood."""

from dataclasses import replace
from math import radians

import pytest

from rover_sim.actuators import Actuator
from rover_sim.body import Pose
from rover_sim.fault_plan import (
    ACTIONS,
    EXAMPLE,
    Disarm,
    Lasting,
    PlanError,
    PlannedFault,
    Push,
    Reboot,
    check_rovers,
    read_fault,
)
from rover_sim.fault_player import FaultPlayer, HandledRover
from rover_sim.faults import Faults
from rover_sim.frames import Frame
from rover_sim.kinematic_bodies import kinematic_body
from rover_sim.manual_control import BodyByHand
from rover_sim.vehicle import make_vehicle
from tests.unit.rover_sim.rig import PROMPT, calm

LEFT = frozenset({Actuator.LEFT})


@pytest.mark.parametrize(
    ("text", "rover", "at", "event", "lasts"),
    [
        (EXAMPLE, None, 10.0, Lasting(blocked=LEFT), 5.0),
        ("AT 10s : block-wheel left FOR 5s", None, 10.0, Lasting(blocked=LEFT), 5.0),
        ("at 1.5: lose-gps", None, 1.5, Lasting(Faults(gps_lost=True)), None),
        ("rover 2 at 3 s: reboot", 2, 3.0, Reboot(), None),
        ("at 3 s: disarm", None, 3.0, Disarm(), None),
        ("at 3 s: push 0.5 m left", None, 3.0, Push(right=-0.5), None),
        ("at 3 s: push back 0.5m", None, 3.0, Push(forward=-0.5), None),
        ("at 3 s: turn 30 deg left", None, 3.0, Push(turn=-radians(30)), None),
        ("at 0 s: freeze-output left", None, 0.0, Lasting(Faults(outputs_frozen=LEFT)), None),
        ("at 0 s: cut-link for 2", None, 0.0, Lasting(Faults(silent=True, deaf=True)), 2.0),
        ("at 0: freeze-position for 2 s", None, 0.0, Lasting(Faults(position_frozen=True)), 2.0),
    ],
)
def test_a_person_can_guess_how_it_is_written(
    text: str, rover: int | None, at: float, event: object, lasts: float | None
) -> None:
    fault = read_fault(text, Frame.SKID)
    assert (fault.rover, fault.at, fault.event, fault.lasts) == (rover, at, event, lasts)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("block-wheel left", f"not understood: 'block-wheel left'; for example: {EXAMPLE}"),
        (
            "at 5 s: explode",
            f"unknown fault 'explode' in 'at 5 s: explode'; expected one of {', '.join(ACTIONS)}",
        ),
        ("at 5 s: block-wheel", "expected left, right or all; write: block-wheel left|right|all"),
        ("at 5 s: block-wheel middle", "wheels are left, right or all, not 'middle'"),
        ("at 5 s: freeze-output steering", "this frame (skid) are left and right, not 'steering'"),
        ("at 5 s: push 1 m up", "expected forward, back, right, left, not 'up'"),
        ("at 5 s: turn 1 deg up", "expected right or left, not 'up'"),
        ("at 5 s: push", "expected an amount and a direction"),
        ("at 5 s: reboot now", "unexpected 'now'"),
        ("at 5 s: reboot for 3 s", "reboot is over at once, leave out 'for'"),
        ("at 5 s: lose-gps for ever", "'ever' is not a number of seconds"),
        ("at 1.2.3 s: reboot", "'1.2.3' is not a number of seconds"),
    ],
)
def test_what_is_not_understood_is_said_in_one_line(text: str, says: str) -> None:
    with pytest.raises(PlanError) as error:
        read_fault(text, Frame.SKID)
    assert says in str(error.value)
    assert "\n" not in str(error.value)


def test_an_ackermann_rover_has_other_outputs() -> None:
    fault = read_fault("at 1 s: freeze-output throttle", Frame.ACKERMANN)
    assert fault.event == Lasting(Faults(outputs_frozen=frozenset({Actuator.THROTTLE})))
    with pytest.raises(PlanError, match="throttle and steering, not 'left'"):
        read_fault("at 1 s: freeze-output left", Frame.ACKERMANN)


def test_a_rover_that_there_is_not_is_refused() -> None:
    plan = [read_fault("rover 3 at 1 s: reboot", Frame.SKID)]
    check_rovers(plan, range(1, 4))
    with pytest.raises(PlanError, match="there is no rover 3"):
        check_rovers(plan, range(1, 3))


def rovers(count: int) -> list[HandledRover]:
    handled = []
    for number in range(1, count + 1):
        bare = kinematic_body(Frame.SKID, start=Pose(), slip=0.0, seed=None)
        body = BodyByHand(bare)
        vehicle = make_vehicle(body, system_id=number, now=0.0, realism=calm(PROMPT))
        handled.append(HandledRover(vehicle, body))
    return handled


def plan(*texts: str) -> list[PlannedFault]:
    return [read_fault(text, Frame.SKID) for text in texts]


def test_what_overlaps_is_joined_and_each_ends_at_its_time() -> None:
    (rover,) = rovers(1)
    lost, stopped = "at 1 s: lose-gps for 3 s", "at 2 s: freeze-output left for 1 s"
    player = FaultPlayer(plan(stopped, lost), [rover])
    assert player.play(0.5, now=0.5) == []
    assert player.play(1.0, now=1.0) == [f"1.0 s: {lost}"]
    assert player.play(2.0, now=2.0) == [f"2.0 s: {stopped}"]
    both = Faults(gps_lost=True, outputs_frozen=LEFT)
    assert rover.vehicle.autopilot.faults == both
    assert player.play(3.0, now=3.0) == [f"3.0 s: over: {stopped}"]
    assert rover.vehicle.autopilot.faults == replace(both, outputs_frozen=frozenset())
    player.play(4.0, now=4.0)
    assert rover.vehicle.autopilot.faults == Faults()


def test_only_the_rover_that_is_named_is_concerned() -> None:
    first, second = rovers(2)
    player = FaultPlayer(plan("rover 2 at 1 s: block-wheel all for 1 s"), [first, second])
    player.play(1.0, now=1.0)
    assert first.body.blocked == frozenset()
    assert second.body.blocked == {Actuator.LEFT, Actuator.RIGHT}
    player.play(2.0, now=2.0)
    assert second.body.blocked == frozenset()


def test_it_is_pushed_and_turned_as_it_sees_it() -> None:
    (rover,) = rovers(1)
    player = FaultPlayer(plan("at 1 s: turn 90 deg right", "at 2 s: push 0.5 m left"), [rover])
    player.play(1.0, now=1.0)
    player.play(2.0, now=2.0)
    state = rover.body.state
    assert (state.north, state.east, state.yaw) == pytest.approx((0.5, 0.0, radians(90)))


def test_it_is_disarmed_and_restarted() -> None:
    (rover,) = rovers(1)
    rover.vehicle.autopilot.operator_arm(True, now=0.0)
    player = FaultPlayer(plan("at 1 s: disarm", "at 2 s: reboot"), [rover])
    player.play(1.0, now=1.0)
    assert not rover.vehicle.autopilot.armed
    rover.vehicle.autopilot.operator_arm(True, now=1.0)
    player.play(2.0, now=2.0)
    assert not rover.vehicle.autopilot.armed
