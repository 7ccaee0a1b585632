"""Home of an unkind rover: it moves as ArduPilot's and PX4's do."""

import math

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavCmd, MavResult
from rover_sim.actuators import SIDES
from rover_sim.body import Pose
from rover_sim.manual_control import BodyByHand
from rover_sim.personas import ARDUPILOT, PX4, Persona
from tests.unit.rover_sim.real_rig import RealRig
from tests.unit.rover_sim.rig import HOLD


class Carried(RealRig):
    """A rover that can be carried."""

    def __init__(self, persona: Persona) -> None:
        super().__init__(persona, wait=3.0)
        self.hands = BodyByHand(self.vehicle.body)
        self.vehicle.body = self.hands

    def carry(self, north: float) -> None:
        self.hands.place(Pose(north=north))

    def home(self) -> float:
        """Metres north, as HOME_POSITION says."""
        self.heard.clear()
        self.ask(MavCmd.REQUEST_MESSAGE, m.HomePosition.id)
        return float(self.last(m.HomePosition).x)

    def disarm(self) -> None:
        self.ask(MavCmd.COMPONENT_ARM_DISARM, 0)

    def arm_in_hold(self) -> None:
        self.set_mode_by(HOLD) if self.vehicle.autopilot.mode.value == "manual" else None
        assert self.try_to_arm().result == MavResult.ACCEPTED


@pytest.mark.parametrize("persona", [ARDUPILOT, PX4])
def test_home_follows_a_disarmed_rover_within_a_second(persona: Persona) -> None:
    rig = Carried(persona)
    assert rig.home() == pytest.approx(0.0, abs=0.1)
    rig.carry(5.0)
    rig.run(1.1)
    assert rig.home() == pytest.approx(5.0, abs=0.1)


@pytest.mark.parametrize("persona", [ARDUPILOT, PX4])
def test_home_stays_while_armed_and_moves_when_disarmed(persona: Persona) -> None:
    rig = Carried(persona)
    rig.arm_in_hold()
    rig.hands.blocked = SIDES  # PX4 would drive back to where HOLD began
    rig.carry(5.0)
    rig.run(3.0)
    assert rig.home() == pytest.approx(0.0, abs=0.1)
    rig.disarm()
    rig.run(1.1)
    assert rig.home() == pytest.approx(5.0, abs=0.1)


@pytest.mark.parametrize(("persona", "moves"), [(ARDUPILOT, False), (PX4, True)])
def test_only_px4_moves_home_when_it_is_armed(persona: Persona, moves: bool) -> None:
    rig = Carried(persona)
    rig.carry(0.4)  # less than what home follows while disarmed
    rig.run(2.0)
    assert rig.home() == pytest.approx(0.0, abs=0.1)
    rig.arm_in_hold()
    assert rig.home() == pytest.approx(0.4 if moves else 0.0, abs=0.1)


@pytest.mark.parametrize("persona", [ARDUPILOT, PX4])
def test_a_place_that_a_person_named_stays_home(persona: Persona) -> None:
    rig = Carried(persona)
    latitude = -35.363262 + 20.0 / 111_318.845
    degrees = (0, 0, 0, 0, latitude, 149.165237, 584)
    assert rig.ask(MavCmd.DO_SET_HOME, *degrees).result == MavResult.ACCEPTED
    rig.carry(5.0)
    rig.run(3.0)
    rig.arm_in_hold()
    rig.disarm()
    rig.run(2.0)
    assert rig.home() == pytest.approx(20.0, abs=0.1)


@pytest.mark.parametrize(("persona", "kept"), [(ARDUPILOT, True), (PX4, False)])
def test_here_is_a_lasting_place_on_ardupilot_only(persona: Persona, kept: bool) -> None:
    rig = Carried(persona)
    assert rig.ask(MavCmd.DO_SET_HOME, 1).result == MavResult.ACCEPTED
    rig.carry(5.0)
    rig.run(3.0)
    assert rig.home() == pytest.approx(0.0 if kept else 5.0, abs=0.1)


def test_a_restart_forgets_what_a_person_named() -> None:
    rig = Carried(ARDUPILOT)
    rig.ask(MavCmd.DO_SET_HOME, 1)
    rig.autopilot.reboot(now=rig.now)
    rig.run(4.0)
    rig.carry(5.0)
    rig.run(2.0)
    assert math.isclose(rig.home(), 5.0, abs_tol=0.1)
