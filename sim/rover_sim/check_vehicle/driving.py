"""Driving by setpoints for a few metres; only with ``drive``."""

import math
from typing import Any

from rover_sim.check_vehicle.arming import arm, shows_armed
from rover_sim.check_vehicle.context import Context
from rover_sim.check_vehicle.drive_controller import (
    ARM_DISARM,
    BODY_NED,
    LOCAL_NED,
    STANDING,
    DriveController,
    Interference,
    bring_to_rest,
)
from rover_sim.check_vehicle.modes import ask_mode, enter_control, send_zeros, shows
from rover_sim.check_vehicle.rates import SET_MESSAGE_INTERVAL
from rover_sim.check_vehicle.telemetry import (
    ATTITUDE,
    GLOBAL_POSITION_INT,
    LOCAL_POSITION_NED,
    METRES_A_DEGREE,
)

SPEED = 0.6  # m/s
TURN_RATE = 0.4  # rad/s: a curve of 1.5 m radius at that speed
LEG = 2.5  # s of driving
AHEAD = 3.0  # m, to the place of a position setpoint
STOP_LIMIT = 4.0  # s to standstill
STREAM_RATE = 20.0  # Hz, of position and attitude
WAY_TOLERANCE = 0.3  # m
SPEED_TOLERANCE = 0.3  # m/s


def check_driving(context: Context) -> None:
    """Arm, drive, stop; on every exit send zeros, HOLD and disarm."""
    probe, report = context.probe, context.report
    if not context.options.drive:
        report.skip("driving", "needs --drive")
        return
    if probe.armed:
        report.skip("driving", "it is armed, and not by us")
        return
    try:
        for message_id in (LOCAL_POSITION_NED, ATTITUDE, GLOBAL_POSITION_INT):
            probe.command(SET_MESSAGE_INTERVAL, message_id, 1e6 / STREAM_RATE)
        if _take_control(context):
            _drive(context)
    except Interference as reason:
        report.fail("driving", expected="a vehicle that nobody else controls", seen=str(reason))
    finally:
        rested = bring_to_rest(context)
        report.expect(
            "left behind",
            rested,
            expected="HOLD and disarmed at the end",
            seen="HOLD, disarmed" if rested else f"mode {probe.custom_mode:#x}, armed",
        )
        for message_id in (LOCAL_POSITION_NED, ATTITUDE, GLOBAL_POSITION_INT):
            probe.command(SET_MESSAGE_INTERVAL, message_id, 0)


def _take_control(context: Context) -> bool:
    """Take control in the order that is safe for this make; zeros replace an old setpoint."""
    if context.way.control_needs_stream:
        ask_mode(context, context.way.hold)
        return arm(context) and _enter(context)
    if not _enter(context):
        return False
    send_zeros(context, 0.2)
    return arm(context)


def _enter(context: Context) -> bool:
    mark = context.probe.mark()
    answer = enter_control(context)
    shown = answer.accepted and _shows_with_zeros(context)
    return context.report.expect(
        "enter the control mode to drive",
        shown,
        expected="ACCEPTED, then shown in the heartbeat",
        seen=f"{answer}{'' if shown else context.probe.texts(mark)}",
    )


def _shows_with_zeros(context: Context) -> bool:
    for _ in range(15):
        send_zeros(context, 0.15)
        if context.probe.custom_mode == context.way.control:
            return True
    return False


def _drive(context: Context) -> None:
    wheel = DriveController(context)
    _check_velocity(context, wheel, LOCAL_NED)
    _check_velocity(context, wheel, BODY_NED)
    _check_yaw_rate(context, wheel)
    _check_place(context, wheel)
    _check_time_out(context, wheel)
    _check_disarm(context, wheel)


def _check_velocity(context: Context, wheel: DriveController, frame: int) -> None:
    report, name = context.report, "LOCAL_NED" if frame == LOCAL_NED else "BODY_NED"
    before = wheel.position
    both_before = _both_positions(context)
    heading = before.yaw if frame == LOCAL_NED else 0.0
    wheel.velocity(SPEED * math.cos(heading), SPEED * math.sin(heading), LEG, frame=frame)
    at_speed, moved = wheel.position.speed, wheel.position.ahead_of(before)
    report.expect(
        f"velocity in {name}",
        0.3 * SPEED * LEG < moved < 1.5 * SPEED * LEG and 0.5 * SPEED < at_speed < 1.5 * SPEED,
        expected=f"{SPEED:g} m/s straight ahead, up to {SPEED * LEG:.1f} m in {LEG:g} s",
        seen=f"{moved:.2f} m ahead, {at_speed:.2f} m/s",
    )
    if frame == LOCAL_NED:
        _check_places_agree(context, both_before, _both_positions(context))
    stood = wheel.wait_standing(STOP_LIMIT)
    report.expect(
        f"zero in {name}",
        stood is not None,
        expected=f"it stands (below {STANDING:g} m/s) within {STOP_LIMIT:g} s of zeros",
        seen=f"{wheel.position.speed:.2f} m/s" if stood is None else f"after {stood:.1f} s",
    )


def _check_places_agree(context: Context, before: Any, after: Any) -> None:
    """Check that LOCAL_POSITION_NED and GLOBAL_POSITION_INT show the same displacement."""
    if None in (*before, *after):
        context.report.skip("one way", "no GLOBAL_POSITION_INT")
        return
    (local, place), (local_after, place_after) = before, after
    north = (place_after.lat - place.lat) * 1e-7 * METRES_A_DEGREE
    shrunk = math.cos(math.radians(place.lat * 1e-7))
    east = (place_after.lon - place.lon) * 1e-7 * METRES_A_DEGREE * shrunk
    off = math.hypot(local_after.x - local.x - north, local_after.y - local.y - east)
    speeds = (
        math.hypot(local_after.vx, local_after.vy),
        math.hypot(place_after.vx / 100, place_after.vy / 100),
    )
    context.report.expect(
        "one way",
        off < WAY_TOLERANCE and abs(speeds[0] - speeds[1]) < SPEED_TOLERANCE,
        expected="LOCAL_POSITION_NED (m, m/s) and GLOBAL_POSITION_INT (degrees × 10⁷, cm/s) agree"
        f" within {WAY_TOLERANCE:g} m and {SPEED_TOLERANCE:g} m/s",
        seen=f"{off:.2f} m apart, {speeds[0]:.2f} and {speeds[1]:.2f} m/s",
    )


def _both_positions(context: Context) -> tuple[Any, Any]:
    probe = context.probe
    return probe.last(LOCAL_POSITION_NED), probe.last(GLOBAL_POSITION_INT)


def _check_yaw_rate(context: Context, wheel: DriveController) -> None:
    """Check a curve and reverse where yaw rates are honoured; note a turn on the spot."""
    if not context.way.honours_yaw_rate:
        turned, _ = _turn(wheel, 0.0, TURN_RATE)
        said = f"{math.degrees(turned):.0f}° in {LEG:g} s (this autopilot ignores yaw rates)"
        context.report.note("yaw rate in BODY_NED", said)
        return
    turned, _ = _turn(wheel, SPEED, TURN_RATE)
    wanted = TURN_RATE * LEG
    context.report.expect(
        "yaw rate in BODY_NED",
        0.4 * wanted < turned < 1.5 * wanted,
        expected=f"{math.degrees(wanted):.0f}° clockwise at {SPEED:g} m/s, or nearly",
        seen=f"{math.degrees(turned):.0f}°",
    )
    _, moved = _turn(wheel, -SPEED, 0.0)
    context.report.expect(
        "backwards in BODY_NED",
        -1.5 * SPEED * LEG < moved < -0.3 * SPEED * LEG,
        expected=f"up to {SPEED * LEG:.1f} m backwards, at yaw rate 0",
        seen=f"{-moved:.2f} m backwards",
    )
    turned, _ = _turn(wheel, 0.0, TURN_RATE)
    seen = f"{math.degrees(turned):.0f}° in {LEG:g} s"
    if turned < 0.4 * wanted:
        context.report.note("on the spot", f"{seen}: it may steer like a car")
    else:
        context.report.ok("on the spot", seen)


def _turn(wheel: DriveController, speed: float, rate: float) -> tuple[float, float]:
    """Drive for a leg; return the turn (rad, clockwise) and the distance ahead (m)."""
    before = wheel.position
    wheel.velocity(speed, 0.0, LEG, frame=BODY_NED, yaw_rate=rate)
    after = wheel.position
    wheel.wait_standing(STOP_LIMIT)
    turned = (after.yaw - before.yaw + math.pi) % (2 * math.pi) - math.pi
    return turned, after.ahead_of(before)


def _check_place(context: Context, wheel: DriveController) -> None:
    before = wheel.position
    north, east = AHEAD * math.cos(before.yaw), AHEAD * math.sin(before.yaw)
    wheel.go_to(before.x + north, before.y + east, 5.0)
    moved = wheel.position.ahead_of(before)
    context.report.expect(
        "position in LOCAL_NED",
        1.0 <= moved <= AHEAD + 1.0,
        expected=f"towards a place {AHEAD:g} m ahead, and not past it",
        seen=f"{moved:.2f} m ahead after 5 s",
    )
    wheel.wait_standing(STOP_LIMIT)


def _check_time_out(context: Context, wheel: DriveController) -> None:
    before = wheel.position
    wheel.velocity(SPEED, 0.0, LEG, frame=BODY_NED)
    if wheel.position.speed < 0.5 * SPEED:
        context.report.skip("setpoints stop", "it did not drive")
        return
    limit = context.way.stops_within
    stood = wheel.wait_standing(limit, silent=True)
    context.report.expect(
        "setpoints stop",
        stood is not None,
        expected=f"it stops by itself within {limit:g} s of the last setpoint",
        seen=f"still {wheel.position.speed:.2f} m/s, {wheel.position.distance_to(before):.1f} m on"
        if stood is None
        else f"stood after {stood:.1f} s, mode {context.probe.custom_mode:#x}",
    )


def _check_disarm(context: Context, wheel: DriveController) -> None:
    if not _enter(context):
        return
    wheel.velocity(SPEED, 0.0, LEG, frame=BODY_NED)
    if wheel.position.speed < 0.5 * SPEED:
        context.report.skip("disarm while driving", "it did not drive")
        return
    mark = context.probe.mark()
    answer = context.probe.command(ARM_DISARM, 0)
    shown = shows_armed(context, armed=False)
    stood = wheel.wait_standing(STOP_LIMIT, silent=True)
    context.report.expect(
        "disarm while driving",
        answer.accepted and shown and stood is not None,
        expected=f"ACCEPTED, shown by the heartbeat, and it stands within {STOP_LIMIT:g} s",
        seen=f"{answer}, {'shown' if shown else 'not shown'},"
        f" {wheel.position.speed:.2f} m/s{'' if shown else context.probe.texts(mark)}",
    )
    ask_mode(context, context.way.hold)
    shows(context, context.way.hold)
