"""Message rates: SET_MESSAGE_INTERVAL and GET_MESSAGE_INTERVAL. The interval is restored."""

from rover_sim.check_vehicle.context import Context
from rover_sim.check_vehicle.telemetry import ATTITUDE

SET_MESSAGE_INTERVAL, GET_MESSAGE_INTERVAL, MESSAGE_INTERVAL = 511, 510, 244
UNKNOWN_MESSAGE = 12_000
RATES = (5.0, 20.0)  # Hz
MEASURED = 2.0  # s
SETTLING = 0.3  # s
TOLERANCE = 0.3


def check_intervals(context: Context) -> None:
    """Set and measure two rates of ATTITUDE, read the second back, and restore the interval."""
    probe, report = context.probe, context.report
    before = _told(context)
    try:
        for rate in RATES:
            answer = probe.command(SET_MESSAGE_INTERVAL, ATTITUDE, 1e6 / rate)
            probe.listen(SETTLING)
            mark, began = probe.mark(), probe.now
            probe.listen(MEASURED)
            seen = len(probe.since(mark, ATTITUDE)) / (probe.now - began)
            report.expect(
                f"ATTITUDE at {rate:g} Hz",
                answer.accepted and abs(seen - rate) <= TOLERANCE * rate,
                expected=f"ACCEPTED by SET_MESSAGE_INTERVAL, then {rate:g} Hz within 30 %",
                seen=f"{answer}, {seen:.1f} Hz",
            )
        told = _told(context)
        report.expect(
            "GET_MESSAGE_INTERVAL",
            told is not None and abs(told - 1e6 / RATES[-1]) <= TOLERANCE * 1e6 / RATES[-1],
            expected=f"a MESSAGE_INTERVAL that tells {1e6 / RATES[-1]:,.0f} µs",
            seen="no MESSAGE_INTERVAL" if told is None else f"{told:,} µs",
        )
    finally:
        probe.command(SET_MESSAGE_INTERVAL, ATTITUDE, float(before or 0))
    answer = probe.command(SET_MESSAGE_INTERVAL, UNKNOWN_MESSAGE, 1e6)
    report.expect(
        "interval of an unknown message",
        answer.refused,
        expected="a refusal within 1 s",
        seen=f"{answer}",
    )


def _told(context: Context) -> int | None:
    mark = context.probe.mark()
    context.probe.command(GET_MESSAGE_INTERVAL, ATTITUDE)
    message = context.probe.wait(
        MESSAGE_INTERVAL, 0.5, since=mark, condition=lambda m: bool(m.message_id == ATTITUDE)
    )
    return None if message is None else int(message.interval_us)
