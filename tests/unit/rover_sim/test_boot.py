"""The boot of the simulated rover, in the times and words of the recordings of real ones.

Each time must lie within a factor of 1.5 of the recorded one.
"""

from dataclasses import replace
from itertools import pairwise

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavCmd, MavResult
from rover_sim.personas import ARDUPILOT, PX4, Persona
from rover_sim.realism import Realism
from tests.unit.rover_sim.rig import GUIDED, INITIALISING, MANUAL, START, Refusal, Rig, command_long

PREARM = 0x10000000


class Recorded(Rig):
    """An ArduPilot that is asked to arm every 3 s, as in the recording, until it is armed."""

    def __init__(self) -> None:
        super().__init__(ARDUPILOT, realism=booting(ARDUPILOT), seed=1, wait=1.05)
        self.refusals: list[Refusal] = []
        assert self.set_mode(GUIDED) == MavResult.ACCEPTED
        while True:
            self.send(command_long(MavCmd.REQUEST_MESSAGE, 49))
            self.armable = self.now - START
            refusal = self.try_to_arm()
            if refusal.result == MavResult.ACCEPTED:
                break
            self.refusals.append(refusal)
            self.run(2.9)
        self.run(20.0)

    def first(self, kind: type[m.Message]) -> float:
        """When, s after switching on, the first of a kind was heard."""
        return self.times(kind)[0] - START


def booting(persona: Persona) -> Realism:
    """As unkind as its make, with the real times of its boot."""
    return replace(persona.realism, boot=persona.boot)


@pytest.fixture(scope="module")
def ardupilot() -> Recorded:
    return Recorded()


def test_ardupilot_can_be_armed_when_the_recorded_one_could(ardupilot: Recorded) -> None:
    assert 25.0 / 1.5 < ardupilot.armable < 25.0 * 1.5


def test_ardupilot_says_why_it_cannot_be_armed(ardupilot: Recorded) -> None:
    refusals = ardupilot.refusals
    assert len(refusals) in range(6, 12)  # recorded: 8
    assert {refusal.result for refusal in refusals} == {MavResult.FAILED}
    reasons = [refusal.texts[-1] for refusal in refusals]
    assert list(dict.fromkeys(reasons)) == [
        "Arm: System not initialised",
        "Arm: Accels inconsistent",
        "Arm: Gyros inconsistent",
    ]


def test_ardupilot_s_positions_begin_when_the_recorded_ones_did(ardupilot: Recorded) -> None:
    for kind, recorded in [
        (m.LocalPositionNed, 10.3),
        (m.HomePosition, 10.2),
        (m.GpsGlobalOrigin, 21.0),
    ]:
        assert recorded / 1.5 < ardupilot.first(kind) < recorded * 1.5


def test_ardupilot_s_receiver_has_no_fix_at_first(ardupilot: Recorded) -> None:
    fixes = [(at, e) for at, e in ardupilot.arrivals if isinstance(e, m.GpsRawInt)]
    assert fixes[0][1].fix_type == 0
    first = next(at for at, each in fixes if each.fix_type == 3) - START
    assert 9.7 / 1.5 < first < 9.7 * 1.5
    assert {(each.lat, each.lon) for _, each in fixes if each.fix_type == 0} == {(0, 0)}


def test_the_pre_arm_bit_is_unhealthy_until_it_can_be_armed(ardupilot: Recorded) -> None:
    states = [(at - START, e) for at, e in ardupilot.arrivals if isinstance(e, m.SysStatus)]
    first = next(at for at, e in states if e.onboard_control_sensors_health & PREARM)
    assert 23.3 / 1.5 < first < 23.3 * 1.5
    assert all(e.onboard_control_sensors_present & PREARM for _, e in states)


def test_a_mode_accepted_in_the_first_second_is_lost_again(ardupilot: Recorded) -> None:
    beats = [(at - START, e) for at, e in ardupilot.arrivals if isinstance(e, m.Heartbeat)]
    modes = [(at, e.custom_mode) for at, e in beats]
    changes = [modes[0], *(b for a, b in pairwise(modes) if a[1] != b[1])]
    assert [mode for _, mode in changes] == [INITIALISING, GUIDED, MANUAL]
    assert 2.2 / 1.5 < changes[2][0] < 2.2 * 1.5


def test_px4_refuses_for_four_seconds_in_two_texts_one_of_them_split() -> None:
    rig = Rig(PX4, realism=booting(PX4), wait=0.0)
    rig.run(3.0)
    assert rig.try_to_arm() == Refusal(
        MavResult.TEMPORARILY_REJECTED,
        (
            "Preflight Fail: system power unavailable",
            "Arming denied: Resolve system health failures first",
        ),
    )
    pieces = [e.text.rstrip("\0") for e in rig.heard if isinstance(e, m.Statustext)]
    assert pieces[1:] == ["Arming denied: Resolve system health failures firs", "t"]
    rig.run(2.0)
    assert rig.try_to_arm().result == MavResult.ACCEPTED
