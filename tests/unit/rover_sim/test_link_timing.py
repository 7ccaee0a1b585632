"""When an unkind rover answers and sends, against the recordings of real ones."""

import statistics
from itertools import pairwise
from statistics import quantiles

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavCmd
from rover_sim.personas import ARDUPILOT, PX4, Persona
from tests.unit.rover_sim.rig import RealRig


def delays_of(persona: Persona) -> list[float]:
    rig = RealRig(persona, wait=3.0)
    delays = []
    for number in range(200):
        rig.run(0.1 + number * 1e-4)
        asked, heard = rig.now, len(rig.times(m.CommandAck))
        rig.send(m.CommandLong(1, 1, MavCmd.REQUEST_MESSAGE, 0, 30, 0, 0, 0, 0, 0, 0))
        rig.run(0.1)
        (at,) = rig.times(m.CommandAck)[heard:]
        delays.append(at - asked)
    return delays


def test_commands_are_answered_as_late_as_by_real_ones() -> None:
    for persona, median, most in [(ARDUPILOT, 0.011, 0.024), (PX4, 0.004, 0.062)]:
        delays = delays_of(persona)
        assert median / 1.5 < statistics.median(delays) < median * 1.5
        assert most / 1.5 < max(delays) <= most + 1e-6


def test_ardupilot_s_positions_come_in_pairs() -> None:
    rig = RealRig(ARDUPILOT, wait=3.0)
    rig.ask(MavCmd.SET_MESSAGE_INTERVAL, m.LocalPositionNed.id, 25_000)
    begun = len(rig.times(m.LocalPositionNed))
    rig.run(120.0)
    times = rig.times(m.LocalPositionNed)[begun:]
    gaps = [b - a for a, b in pairwise(times)]
    cuts = quantiles(gaps, n=100)
    assert len(times) == pytest.approx(120 * 40, rel=0.01)
    assert 0.022 / 1.5 < cuts[49] < 0.022 * 1.5
    assert 0.042 / 1.5 < cuts[94] < 0.042 * 1.5
    assert 0.088 / 1.5 < max(gaps) < 0.088 * 1.5
    assert 0.05 < sum(gap < 0.001 for gap in gaps) / len(gaps) < 0.2  # two at once


def test_ardupilot_shows_arming_with_its_next_heartbeat() -> None:
    """Recorded, disarming was to be seen 0.5 and 0.75 s later."""
    rig = RealRig(ARDUPILOT, wait=3.3)
    rig.arrivals.clear()
    asked = rig.now
    rig.send(m.CommandLong(1, 1, MavCmd.COMPONENT_ARM_DISARM, 0, 1, 0, 0, 0, 0, 0, 0))
    rig.run(1.0)
    assert rig.autopilot.armed
    assert 0.3 < rig.times(m.Heartbeat)[0] - asked < 1.0
