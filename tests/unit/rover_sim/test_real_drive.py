"""The drive trains beside recordings of real autopilots: each figure within a factor of 1.5.

The recordings: ArduPilot Rover 4.6.3 (SITL, rover and rover-skid) and PX4 1.17.0 (a differential
rover and SIH's Ackermann rover); steps of speed for 5 s, zeros, HOLD and disarming at 1 m/s.
"""

from collections.abc import Callable, Mapping
from math import radians

import pytest

from mav_tasks.mavlink.enums import MavCmd
from rover_sim.frames import Frame
from tests.unit.rover_sim.rig import (
    HOLD,
    PX4_HOLD,
    Rig,
    ahead,
    ardupilot,
    body_velocity,
    px4,
    record,
)

FACTOR = 1.5
RIGS: Mapping[str, Callable[[], Rig]] = {
    "ardupilot ackermann": lambda: ardupilot(Frame.ACKERMANN),
    "ardupilot skid": lambda: ardupilot(Frame.SKID),
    "px4 differential": lambda: px4(Frame.DIFFERENTIAL),
    "px4 ackermann": lambda: px4(Frame.ACKERMANN),
}


def close(simulated: float, real: float, least: float = 0.02) -> bool:
    """Whether two figures differ by a factor of 1.5 at most, or by less than counts."""
    if abs(simulated - real) <= least:
        return True
    return simulated * real > 0 and 1 / FACTOR <= simulated / real <= FACTOR


def at_1_m_s(name: str) -> Rig:
    rig = RIGS[name]()
    record(rig, 5.0, ahead(rig, 1.0))
    return rig


def test_a_step_of_speed_rises_overshoots_and_settles_as_recorded() -> None:
    for name, asked, steady, peak, rise in [
        ("ardupilot ackermann", 0.5, 0.503, 0.675, (0.32, 0.71, 0.95)),
        ("ardupilot ackermann", 1.0, 0.997, 1.29, (0.38, 1.02, 1.26)),
        ("ardupilot ackermann", 2.0, 2.133, 2.44, (0.56, 1.52, 1.92)),
        ("ardupilot skid", 0.5, 0.526, 0.55, (0.21, 0.53, 0.69)),
        ("ardupilot skid", 1.0, 1.027, 1.08, (0.28, 0.83, 1.07)),
        ("ardupilot skid", 2.0, 2.047, 2.12, (0.41, 1.41, 1.89)),
        ("px4 differential", 0.5, 0.5, 0.5, (0.07, 0.20, 0.28)),
        ("px4 differential", 1.0, 1.0, 1.0, (0.09, 0.26, 0.39)),
        ("px4 differential", 2.0, 1.804, 1.804, (0.15, 0.44, 0.86)),  # RO_SPEED_LIM is 1.8
        ("px4 ackermann", 0.5, 0.0, 0.0, None),
        ("px4 ackermann", 1.0, 1.370, 1.37, (0.53, 0.73, 0.85)),
        ("px4 ackermann", 2.0, 2.496, 2.5, (0.53, 0.78, 0.90)),
    ]:
        rig = RIGS[name]()
        run = record(rig, 5.0, ahead(rig, asked))
        assert run.steady() == pytest.approx(steady, rel=0.06, abs=0.001)
        assert close(run.peak - asked, peak - asked, least=0.02)
        if rise is not None:
            times = [run.reached(part * asked) for part in (0.1, 0.63, 0.9)]
            assert all(map(close, times, rise, [0.07] * 3)), times


def test_zeros_stop_it_as_recorded() -> None:
    for name, asked, seconds, metres in [
        ("ardupilot ackermann", 0.5, 3.59, 0.47),
        # real: 3.69 s. Its estimate was 0.02 m/s too slow, so the throttle was cut the earlier
        ("ardupilot ackermann", 1.0, None, 0.96),
        ("ardupilot ackermann", 2.0, 2.19, 2.44),
        ("ardupilot skid", 0.5, 1.00, 0.23),
        ("ardupilot skid", 1.0, 1.46, 0.68),
        ("ardupilot skid", 2.0, 2.36, 2.38),
        ("px4 differential", 0.5, 0.31, 0.05),
        ("px4 differential", 1.0, 0.41, 0.14),
        ("px4 differential", 2.0, 0.57, 0.40),
        ("px4 ackermann", 1.0, 0.74, 0.64),
        ("px4 ackermann", 2.0, 1.15, 1.69),
    ]:
        rig = RIGS[name]()
        record(rig, 5.0, ahead(rig, asked))
        after, way = record(rig, 6.0, ahead(rig, 0.0)).stood_after
        assert seconds is None or close(after, seconds, least=0.1), after
        assert close(way, metres), way


def test_hold_at_1_m_s_is_as_recorded() -> None:
    for name, mode, seconds, metres in [
        ("ardupilot ackermann", HOLD, 7.03, 2.18),  # the throttle is cut, and it rolls
        ("ardupilot skid", HOLD, 1.17, 0.45),
        ("px4 differential", PX4_HOLD, 0.41, 0.16),
        ("px4 ackermann", PX4_HOLD, 4.02, 5.66),  # a loop back to where HOLD began
    ]:
        rig = at_1_m_s(name)
        rig.set_mode(mode)
        after, way = record(rig, 9.0).stood_after
        assert close(after, seconds, least=0.1), after
        assert close(way, metres), way


def test_disarmed_at_1_m_s_it_rolls_as_recorded() -> None:
    for name, seconds, metres in [
        ("ardupilot ackermann", 7.03, 2.13),
        ("ardupilot skid", 1.05, 0.31),
        ("px4 differential", 0.36, 0.10),
        ("px4 ackermann", 7.0, 2.7),  # not recorded: SIH's rolls for ever, by its world's fault
    ]:
        rig = at_1_m_s(name)
        rig.command(MavCmd.COMPONENT_ARM_DISARM, 0)
        after, way = record(rig, 9.0).stood_after
        assert close(after, seconds), after
        assert close(way, metres), way


def test_an_ackermann_ardupilot_turns_by_half_of_what_is_asked() -> None:
    run = record(ardupilot(Frame.ACKERMANN), 5.0, body_velocity(0.5, radians(20)))
    assert close(run.turned, 48.4)
    assert close(run.peak_rate, 12.9)
    assert close(run.way, 2.56)


def test_a_skid_steered_ardupilot_turns_on_the_spot_as_recorded() -> None:
    run = record(ardupilot(Frame.SKID), 4.0, body_velocity(0.0, radians(30)))
    assert close(run.turned, 117.2)
    assert run.peak_rate == pytest.approx(32.5, abs=3.0)
    assert run.way < 0.01
