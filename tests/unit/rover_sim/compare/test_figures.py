"""The figures of drives whose every number is known."""

import math

import pytest

from rover_sim.compare.figure import Value
from rover_sim.compare.figures import driving, endings, estimate, places, standing, start, turning
from rover_sim.compare.figures.motion import rest_of
from rover_sim.compare.manoeuvres import (
    ARMED,
    DISARM,
    DISARMED_AGAIN,
    READYING,
    SILENCE,
    STANDING_ARMED,
    STANDING_DISARMED,
)
from rover_sim.compare.measuring import middle
from rover_sim.compare.trace import Trace
from tests.unit.rover_sim.compare.traces import PERIOD, PX4, hear, send, trace_of, value_of

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


def test_a_step_that_moves_nothing_never_reaches_its_speed() -> None:
    figures = driving.figures(trace_of(lambda _: 0.0, STEP))

    assert value_of(figures, "reaches 10 % of what was asked") is None
    assert value_of(figures, "peak over what was asked") == -100.0
    assert value_of(figures, "stops after") == 0.0


def test_a_px4_step_counts_the_speed_along_the_course() -> None:
    back = trace_of(
        lambda _: 0.5,
        {"-0.5 m/s": 0.0, "-0.5 m/s, then zeros": 5.0, "end": 6.0},
        yaw_rate=lambda at: math.pi if at < 1.0 else 0.0,
        autopilot=PX4,
    )

    figures = driving.figures(back)

    assert value_of(figures, "steady speed") == pytest.approx(-0.5, abs=0.001)
    assert value_of(figures, "yaw changed") == pytest.approx(180.0, abs=5.0)


def test_a_rover_that_swings_back_has_not_stood_before() -> None:
    def swing(at: float) -> float:
        return math.cos(at * math.pi) if at < 1.0 else -1.0 if at < 2.0 else 0.0

    rest = rest_of(trace_of(swing, {"start": 0.0, "end": 4.0}).poses, 0.0)

    assert rest is not None
    assert rest.after == pytest.approx(2.0, abs=PERIOD)


def test_a_rover_that_rolls_on_does_not_stand() -> None:
    assert rest_of(trace_of(lambda _: 0.1, {"start": 0.0, "end": 4.0}).poses, 0.0) is None


def test_a_turn_tells_rate_and_angle() -> None:
    rate = math.radians(30)
    marks = {"+30 deg/s on the spot": 0.0, "+30 deg/s on the spot, then zeros": 4.0, "end": 7.0}

    turn = trace_of(lambda _: 0.0, marks, yaw_rate=lambda at: rate if 0.5 <= at < 4.5 else 0.0)
    figures = turning.figures(turn)

    assert value_of(figures, "rate reached") == pytest.approx(30.0)
    assert value_of(figures, "reaches 63 % of the rate asked") == pytest.approx(0.5)
    assert value_of(figures, "turned") == pytest.approx(105.0, abs=1.0)
    assert value_of(figures, "turned on after zeros") == pytest.approx(15.0, abs=1.0)


def standing_trace() -> Trace:
    marks = {STANDING_DISARMED: 0.0, READYING: 20.0, STANDING_ARMED: 22.0, "end": 42.0}
    trace = trace_of(lambda _: 0.0, marks)
    for count in range(42 * 40):
        at = count / 40
        vx, vy = 0.03 + 0.01 * math.sin(at * math.tau / 10), 0.04
        hear(trace, "LOCAL_POSITION_NED", at, x=0.01 * math.sin(at), y=0.0, vx=vx, vy=vy)
        hear(trace, "ATTITUDE", at, yaw=math.radians(1.0), yawspeed=math.radians(-0.2))
    return trace


def test_a_standing_rover_tells_its_offset_and_how_slowly_it_wanders() -> None:
    figures = [f for f in standing.figures(standing_trace()) if f.group == "Standing disarmed"]

    assert value_of(figures, "reported speed, p50") == pytest.approx(0.05, abs=0.002)
    assert value_of(figures, "reported speed below 0.03 m/s") == 0.0
    assert value_of(figures, "reported velocity, its mean") == pytest.approx(0.05, abs=0.001)
    # a sine of 10 s is 0.81 alike after 1 s, and upside down after 3 s
    assert value_of(figures, "its north part alike after 1 s") == pytest.approx(0.81, abs=0.06)
    assert value_of(figures, "its north part alike after 3 s") == pytest.approx(-0.31, abs=0.1)
    assert value_of(figures, "reported yaw rate, p50") == pytest.approx(0.2)


def test_the_estimate_is_held_against_the_truth() -> None:
    figures = estimate.figures(standing_trace())

    assert value_of(figures, "reported yaw off the true one, p50") == pytest.approx(1.0)
    assert value_of(figures, "reported velocity off the true one, p50") == pytest.approx(
        0.05, abs=0.002
    )
    assert value_of(figures, "reported position off, against the start, max") == pytest.approx(
        0.0105, abs=0.0005
    )
    assert value_of(figures, "between two LOCAL_POSITION_NED, p50") == pytest.approx(0.025)


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([3.0, 1.0, 2.0], 2.0),
        (["yes", "no", "yes"], "yes"),
        ([None, 1.0, None], None),
        ([7], 7),
    ],
)
def test_of_several_runs_the_middle_counts(values: list[Value], expected: Value) -> None:
    assert middle(values) == expected


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


def test_home_that_follows_the_rover_is_counted() -> None:
    trace = trace_of(lambda _: 0.0, {DISARM: 0.0, READYING: 5.0, DISARMED_AGAIN: 10.0, "end": 20.0})
    for at, latitude in ((0.0, 0), (1.0, 100), (2.0, 200), (6.0, 200), (11.0, 300)):
        hear(trace, "HOME_POSITION", at, latitude=latitude, longitude=0, altitude=5000)

    figures = places.figures(trace)

    assert value_of(figures, "home's moves when disarmed at 1 m/s") == 2
    assert value_of(figures, "home moves when disarmed") == "yes"
    assert value_of(figures, "home moves when armed") == "no"
    assert value_of(figures, "HOME_POSITION, farthest from the first") == pytest.approx(
        3.34, abs=0.01
    )
