"""One output that is frozen, no satellites: what the rover then does."""

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavCmd, MavResult
from rover_sim.actuators import Actuator
from rover_sim.faults import Faults
from rover_sim.modes import Mode
from rover_sim.personas import ARDUPILOT, PX4, Persona
from tests.unit.rover_sim.rig import HOLD, Rig, velocity


def driven(persona: Persona, speed: float) -> Rig:
    """Return a rover that has driven north for 5 s, and no earlier texts of it."""
    rig = Rig(persona)
    rig.ready_to_drive()
    rig.run(5.0, velocity(speed))
    rig.take(m.Statustext)
    return rig


def test_with_one_output_frozen_it_circles_on_in_hold() -> None:
    """A13: 0.32 m/s for as long as was watched, no text, no disarm; it drove 0.64 m/s then."""
    rig = driven(ARDUPILOT, 0.64)
    rig.autopilot.set_faults(Faults(outputs_frozen=frozenset({Actuator.LEFT})))
    assert rig.set_mode(HOLD) == MavResult.ACCEPTED
    for _ in range(2):
        rig.run(10.0)
        assert rig.truth.forward_speed == pytest.approx(0.32, abs=0.03)
        assert rig.truth.yaw_rate > 0.3  # the left wheels drive it to the right
    assert (rig.autopilot.armed, rig.texts()) == (True, [])


def test_without_satellites_it_drives_on_for_5_s_and_then_has_no_position() -> None:
    for persona, said, armed in [
        (ARDUPILOT, ["EKF failsafe"], True),
        (PX4, ["Failsafe activated", "Disarmed by landing"], False),
    ]:
        rig = driven(persona, 0.5)
        rig.autopilot.set_faults(Faults(gps_lost=True))
        rig.run(4.0, velocity(0.5))
        assert rig.autopilot.mode is Mode.GUIDED
        assert rig.take(m.LocalPositionNed) != []
        rig.command(MavCmd.REQUEST_MESSAGE, m.GpsRawInt.id)
        assert rig.last(m.GpsRawInt).fix_type == 0
        rig.run(6.0, velocity(0.5))
        assert [text for text in rig.texts() if text in said] == said
        rig.heard.clear()
        rig.run(2.0, velocity(0.5))
        assert rig.take(m.LocalPositionNed) == []
        assert (rig.truth.forward_speed, rig.autopilot.armed) == (0.0, armed)
        if armed:
            rig.command(MavCmd.COMPONENT_ARM_DISARM, 0)
            assert rig.arm() == MavResult.FAILED
            assert rig.texts()[-1] == "Arm: Need Position Estimate"
            rig.autopilot.set_faults(Faults())
            assert rig.arm() == MavResult.ACCEPTED
