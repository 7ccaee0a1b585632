"""Modes of a disarmed vehicle: HOLD, the control mode, and one that does not exist."""

from rover_sim.check_vehicle.context import Context
from rover_sim.check_vehicle.conventions import CUSTOM_MODE
from rover_sim.check_vehicle.probe import AUTOPILOT, HEARTBEAT, Answer

DO_SET_MODE = 176
SHOWN_WITHIN = 2.0  # s until a heartbeat shows a mode
STREAM_FIRST = 1.0  # s of zeros before a mode that needs them
ZERO_PERIOD = 0.05  # s


def check_modes(context: Context) -> None:
    """Enter each mode and wait for the heartbeat to show it; then restore the previous mode."""
    probe, report, way = context.probe, context.report, context.way
    if probe.armed:
        report.skip("modes", "it is armed: changing its mode could move it")
        return
    before = probe.custom_mode
    try:
        _check_entering(context, "HOLD", way.hold)
        _check_entering(context, "the control mode", way.control)
        _check_old_message(context)
        present, answer = probe.custom_mode, ask_mode(context, way.nonsense)
        if way.accepts_nonsense:
            probe.wait(HEARTBEAT, SHOWN_WITHIN, since=probe.mark())
        is_answered = answer.accepted if way.accepts_nonsense else False
        report.expect(
            "a mode that does not exist",
            (answer.refused or is_answered) and probe.custom_mode in (present, before),
            expected="an answer, and the same mode" if way.accepts_nonsense else "a refusal",
            seen=f"{answer}, mode {probe.custom_mode:#x}",
        )
    finally:
        ask_mode(context, before)
        probe.wait(HEARTBEAT, 1.5, since=probe.mark())


def ask_mode(context: Context, custom_mode: int) -> Answer:
    """Send DO_SET_MODE in this make's form."""
    if context.way.mode_in_two_parts:
        params = (CUSTOM_MODE, custom_mode >> 16 & 0xFF, custom_mode >> 24)
        return context.probe.command(DO_SET_MODE, *params)
    return context.probe.command(DO_SET_MODE, CUSTOM_MODE, custom_mode)


def shows(context: Context, custom_mode: int, within: float = SHOWN_WITHIN) -> float | None:
    """Wait for a heartbeat with a mode; return the seconds that it took, or None."""
    began, mark = context.probe.now, context.probe.mark()
    beat = context.probe.wait(
        HEARTBEAT, within, since=mark, condition=lambda m: bool(m.custom_mode == custom_mode)
    )
    return None if beat is None else context.probe.now - began


def enter_control(context: Context) -> Answer:
    """Request the control mode, after zeros if the make needs them. Never moves the vehicle."""
    if context.way.control_needs_stream:
        send_zeros(context, STREAM_FIRST)
    return ask_mode(context, context.way.control)


def send_zeros(context: Context, seconds: float) -> None:
    """Stream zero velocity for ``seconds``."""
    probe = context.probe
    end = probe.now + seconds
    while probe.now < end:
        probe.send(
            probe.messages.set_position_target_local_ned_encode(
                0, probe.system_id, AUTOPILOT, 1, 0x0DC7, *(0.0,) * 11
            )
        )
        probe.listen(ZERO_PERIOD)


def _check_entering(context: Context, name: str, mode: int) -> None:
    mark = context.probe.mark()
    controlling = mode == context.way.control
    answer = enter_control(context) if controlling else ask_mode(context, mode)
    took = shows(context, mode) if answer.accepted else None
    context.report.expect(
        f"enter {name}",
        took is not None,
        expected=f"ACCEPTED, then custom_mode {mode:#x} in the heartbeat within {SHOWN_WITHIN:g} s",
        seen=f"{answer}, "
        + (f"not shown: {context.probe.custom_mode:#x}" if took is None else f"shown {took:.1f} s")
        + ("" if answer.accepted else context.probe.texts(mark)),
    )


def _check_old_message(context: Context) -> None:
    """Check SET_MODE, as QGroundControl sends it to PX4; some vehicles ack it, none has to."""
    probe, hold = context.probe, context.way.hold
    probe.send(probe.messages.set_mode_encode(probe.system_id, CUSTOM_MODE, hold))
    took = shows(context, hold)
    context.report.expect(
        "SET_MODE message",
        took is not None,
        expected=f"custom_mode {hold:#x} (HOLD) in the heartbeat within {SHOWN_WITHIN:g} s",
        seen=f"{probe.custom_mode:#x}" if took is None else f"shown {took:.1f} s",
    )
