"""Faults by the clock: how they are written, and what is said of what is not understood."""

from math import radians

import pytest

from rover_sim.actuators import Actuator
from rover_sim.fault_plan import (
    ACTIONS,
    EXAMPLE,
    Disarm,
    Lasting,
    PlanError,
    Push,
    Reboot,
    read_fault,
)
from rover_sim.faults import Faults
from rover_sim.frames import Frame

LEFT = frozenset({Actuator.LEFT})


def test_a_person_can_guess_how_it_is_written() -> None:
    for text, rover, at, event, lasts in [
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
    ]:
        fault = read_fault(text, Frame.SKID)
        assert (fault.rover, fault.at, fault.event, fault.lasts) == (rover, at, event, lasts)


def test_what_is_not_understood_is_said_in_one_line() -> None:
    for text, says in [
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
    ]:
        with pytest.raises(PlanError) as error:
            read_fault(text, Frame.SKID)
        assert says in str(error.value)
        assert "\n" not in str(error.value)
