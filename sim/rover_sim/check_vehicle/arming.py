"""Arming and disarming in HOLD; only with ``arm``."""

from rover_sim.check_vehicle.context import Context
from rover_sim.check_vehicle.drive_controller import ARM_DISARM, bring_to_rest
from rover_sim.check_vehicle.modes import SHOWN_WITHIN, ask_mode, shows
from rover_sim.check_vehicle.probe import ARMED, HEARTBEAT, Answer

EXTENDED_SYS_STATE, IN_AIR = 245, 2
PATIENCE = 15.0  # s in which a vehicle may still refuse after its start


def check_arming(context: Context) -> None:
    """Arm and disarm; the heartbeat must show both."""
    probe, report = context.probe, context.report
    if not context.options.arm:
        report.skip("arm and disarm", "needs --arm")
        return
    if probe.armed:
        report.skip("arm and disarm", "it is armed, and not by us")
        return
    ask_mode(context, context.way.hold)
    shows(context, context.way.hold)
    try:
        if arm(context):
            _check_seen_flying(context)
            answer = probe.command(ARM_DISARM, 0)
            took = shows_armed(context, armed=False)
            report.expect(
                "disarm",
                answer.accepted and took,
                expected=f"ACCEPTED, and a heartbeat that shows it within {SHOWN_WITHIN:g} s",
                seen=f"{answer}, {'shown' if took else 'not shown'}",
            )
    finally:
        bring_to_rest(context)


def arm(context: Context) -> bool:
    """Arm, with retries; report the result in a line."""
    probe = context.probe
    mark, end = probe.mark(), probe.now + PATIENCE
    while True:
        answer: Answer = probe.command(ARM_DISARM, 1)
        if answer.accepted or probe.now >= end:
            break
        probe.listen(1.0)
    shown = answer.accepted and shows_armed(context, armed=True)
    return context.report.expect(
        "arm",
        shown,
        expected=f"ACCEPTED, and a heartbeat that shows it within {SHOWN_WITHIN:g} s",
        seen=f"{answer}, {'shown' if shown else 'not shown'}"
        + ("" if shown else probe.texts(mark)),
    )


def shows_armed(context: Context, *, armed: bool) -> bool:
    """Wait for a heartbeat with this arming state; return whether it came."""
    beat = context.probe.wait(
        HEARTBEAT,
        SHOWN_WITHIN,
        since=context.probe.mark(),
        condition=lambda m: bool(m.base_mode & ARMED) is armed,
    )
    return beat is not None


def _check_seen_flying(context: Context) -> None:
    """Check landed_state: QGroundControl hides "go to" and "pause" unless the vehicle flies."""
    if not context.way.landed_state_counts:
        return
    probe, name = context.probe, "counts as under way while armed"
    state = probe.wait(
        EXTENDED_SYS_STATE,
        2.5,
        since=probe.mark(),
        condition=lambda m: bool(m.landed_state == IN_AIR),
    )
    if state is None:
        said = "landed_state is not IN_AIR: QGroundControl offers neither go to nor pause"
        context.report.note(name, said)
    else:
        context.report.ok(name, "landed_state IN_AIR")
