"""Identity: heartbeat, packets, version and capabilities."""

from itertools import pairwise

from rover_sim.check_vehicle.context import Context
from rover_sim.check_vehicle.conventions import CUSTOM_MODE, way_of
from rover_sim.check_vehicle.probe import AUTOPILOT, HEARTBEAT

REQUEST_MESSAGE, AUTOPILOT_VERSION = 512, 148
ROVER, BOAT = 10, 11  # MAV_TYPE
LISTENING = 5.0  # s
LONGEST_GAP = 1.9  # s; with one lost heartbeat it is 2
LOSS_LIMIT = 0.01  # of the packets
CAPABILITIES = {4: "MISSION_INT", 8: "COMMAND_INT", 8192: "MAVLINK2"}


def check_heartbeat(context: Context) -> None:
    """Listen for a while and check the heartbeats."""
    probe, report = context.probe, context.report
    mark = probe.mark()
    probe.listen(LISTENING)
    beats = probe.since(mark, HEARTBEAT)
    gaps = [after.at - before.at for before, after in pairwise(beats)]
    seen = f"{len(beats)} in {LISTENING:g} s, longest gap {max(gaps, default=LISTENING):.2f} s"
    steady = len(beats) >= LISTENING - 1.5 and max(gaps, default=LISTENING) < LONGEST_GAP
    report.expect("heartbeat rate", steady, expected="1 Hz", seen=seen)
    beat = context.first.message
    report.expect(
        "type",
        beat.type in (ROVER, BOAT),
        expected="MAV_TYPE 10 (ground rover) or 11 (boat), also in the very first heartbeat",
        seen=f"{beat.type}",
    )
    wanted = context.options.persona
    report.expect(
        "autopilot",
        wanted in ("auto", way_of(beat.autopilot).name),
        expected=f"a {wanted} rover",
        seen=f"MAV_AUTOPILOT {beat.autopilot}: {way_of(beat.autopilot).name}",
    )
    report.expect(
        "mode flags",
        bool(beat.base_mode & CUSTOM_MODE),
        expected="base_mode with CUSTOM_MODE_ENABLED (1): its modes are in custom_mode",
        seen=f"base_mode {beat.base_mode}, custom_mode {beat.custom_mode:#x}",
    )
    report.expect(
        "system status",
        1 <= beat.system_status <= 8,
        expected="a MAV_STATE from 1 to 8",
        seen=f"{beat.system_status}",
    )


def check_version(context: Context) -> None:
    """Request AUTOPILOT_VERSION, with both forms of the command."""
    probe, report = context.probe, context.report
    mark = probe.mark()
    answer = probe.command(REQUEST_MESSAGE, AUTOPILOT_VERSION)
    version = probe.wait(AUTOPILOT_VERSION, 1.0, since=mark)
    found = report.expect(
        "AUTOPILOT_VERSION",
        answer.accepted and version is not None,
        expected="ACCEPTED and the message within 1 s (clients wait for it before all else)",
        seen=f"{answer}, {'the message' if version is not None else 'no message'}",
    )
    if not found:
        return
    lacking = [name for bit, name in CAPABILITIES.items() if not version.capabilities & bit]
    report.expect(
        "capabilities",
        not lacking,
        expected=", ".join(CAPABILITIES.values()),
        seen=f"{version.capabilities:#x}" + (f", without {', '.join(lacking)}" if lacking else ""),
    )
    as_int = probe.command_int(REQUEST_MESSAGE, AUTOPILOT_VERSION)
    report.expect(
        "COMMAND_INT", as_int.accepted, expected="the same answer by COMMAND_INT", seen=f"{as_int}"
    )


def check_packets(context: Context) -> None:
    """Check every packet of the whole run; this is the last check."""
    probe, report = context.probe, context.report
    packets, lost = probe.packets[AUTOPILOT], probe.lost[AUTOPILOT]
    report.expect(
        "sequence numbers",
        lost <= LOSS_LIMIT * packets,
        expected="one after another, for this component alone (gaps are shown as lost packets)",
        seen=f"{lost} missing of {packets + lost}",
    )
    report.expect(
        "MAVLink 2",
        probe.mavlink_1 == 0,
        expected="packets of MAVLink 2 to a client that speaks it",
        seen=f"{probe.mavlink_1} of MAVLink 1",
    )
    report.expect(
        "whole packets",
        probe.damaged <= LOSS_LIMIT * packets,
        expected="packets with a right checksum",
        seen=f"{probe.damaged} damaged",
    )
