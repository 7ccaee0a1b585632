"""The figures of drives whose every number is known."""

import math

import pytest

from rover_sim.compare.figures import driving, endings, start
from rover_sim.compare.manoeuvres import (
    ARMED,
    SILENCE,
)
from tests.unit.rover_sim.compare.traces import PERIOD, hear, send, trace_of, value_of

STEP = {"1 m/s": 0.0, "1 m/s, then zeros": 5.0, "end": 10.0}


def ramp(at: float) -> float:
    """Speeds up at 1 m/s² to 1.2, settles at 1, brakes at 1 m/s² from 5 s on."""
    if at < 1.2:
        return at
    return 1.0 if at < 5.0 else max(0.0, 6.0 - at)


def test_a_step_tells_rise_overshoot_and_stop() -> None:
    figures = driving.figures(trace_of(ramp, STEP))

    assert value_of(figures, "steady speed") == 1.0
    assert value_of(figures, "reaches 10 % of what was asked") == pytest.approx(0.1, abs=PERIOD)
    assert value_of(figures, "reaches 90 % of what was asked") == pytest.approx(0.9, abs=PERIOD)
    assert value_of(figures, "peak over what was asked") == pytest.approx(20.0, abs=3.0)
    assert value_of(figures, "stops after") == pytest.approx(0.97, abs=PERIOD)
    assert value_of(figures, "stops within") == pytest.approx(0.5, abs=0.03)
    assert value_of(figures, "swings back to") == 0.0


def test_silence_is_counted_from_the_last_setpoint() -> None:
    trace = trace_of(lambda at: 1.0 if at < 4.0 else 0.0, {SILENCE: 1.0, "end": 6.0})
    send(trace, "SET_POSITION_TARGET_LOCAL_NED", 0.95)
    for at, mode, base in ((1.0, 15, 128), (3.0, 15, 128), (4.0, 4, 128), (5.0, 4, 0)):
        hear(trace, "HEARTBEAT", at, base_mode=base, custom_mode=mode)
    hear(trace, "STATUSTEXT", 4.0, text="target not received last 3secs, stopping")

    figures = endings.figures(trace)

    assert value_of(figures, "slower by a tenth after") == pytest.approx(3.05)
    assert value_of(figures, "stands within") == pytest.approx(3.0, abs=0.03)
    assert value_of(figures, "modes") == "MANUAL disarmed, GUIDED, HOLD, HOLD disarmed"
    assert value_of(figures, "texts") == "target not received last #secs, stopping"


def test_the_start_counts_refusals_and_their_reasons() -> None:
    trace = trace_of(lambda _: 0.0, {"start": 0.0, ARMED: 6.0, "end": 8.0})
    hear(trace, "ATTITUDE", 0.1, yaw=math.pi / 2, yawspeed=0.0)
    hear(trace, "LOCAL_POSITION_NED", 2.0, x=0.0, y=0.0)
    hear(trace, "LOCAL_POSITION_NED", 2.1, x=0.3, y=0.4)
    for at, result in ((1.0, 4), (4.0, 4), (5.5, 0)):
        send(trace, "COMMAND_LONG", at, command=400, param2=0.0)
        hear(trace, "COMMAND_ACK", at + 0.01, command=400, result=result)
        if result:
            hear(trace, "STATUSTEXT", at, text="Arm: System not initialised")
    hear(trace, "HOME_POSITION", 3.0, x=math.nan, y=math.nan, z=math.nan)

    figures = start.figures(trace)

    assert value_of(figures, "arming refused, times") == 2
    assert value_of(figures, "arming refused with") == "failed"
    assert value_of(figures, "arming accepted") == pytest.approx(5.51)
    assert value_of(figures, "reasons given") == "Arm: System not initialised"
    assert value_of(figures, "first HOME_POSITION has numbers for x, y, z") == "no"
    assert value_of(figures, "yaw of the first ATTITUDE off the true one") == pytest.approx(90.0)
    leap = "largest leap of the reported position before driving"
    assert value_of(figures, leap) == pytest.approx(0.5)
    assert value_of(figures, "first GPS_GLOBAL_ORIGIN") is None
