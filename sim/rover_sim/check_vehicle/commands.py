"""Answers: every request gets one, because silence costs a client seconds, or its whole link."""

from typing import Any

from pymavlink.generator.mavcrc import x25crc

from rover_sim.check_vehicle.context import Context
from rover_sim.check_vehicle.identity import AUTOPILOT_VERSION, REQUEST_MESSAGE
from rover_sim.check_vehicle.probe import AUTOPILOT, COMMAND_LIMIT, HEARTBEAT, OURS

PROTOCOL_VERSION, TIMESYNC, FILE_TRANSFER, AVAILABLE_MODES = 300, 111, 110, 435
PROTOCOL_VERSION_EXTRA = 217  # CRC_EXTRA
MAVLINK_2_VERSION = 200
HEADER_LENGTH = 10  # of MAVLink 2
UNKNOWN_COMMAND = 31_999  # a user command that no vehicle implements
OPEN_FILE, TERMINATE_SESSION, FTP_ACK, FTP_NAK = 4, 1, 128, 129
OUR_TIME = 123_456_789_000  # ns, to be returned unchanged
#: requested by QGroundControl at connect, besides those that other checks cover
OPTIONAL = {
    397: "COMPONENT_METADATA",
    395: "COMPONENT_INFORMATION",
    280: "GIMBAL_MANAGER_INFORMATION",
}
UNKNOWN_MESSAGE = 12_000


def check_answers(context: Context) -> None:
    """Send requests that few vehicles support, and some that none does."""
    probe, report = context.probe, context.report
    mark = probe.mark()
    answer = probe.command(REQUEST_MESSAGE, HEARTBEAT)
    beat = probe.since(mark, HEARTBEAT)
    report.expect(
        "heartbeat on request",
        answer.accepted and bool(beat),
        expected="ACCEPTED, and a HEARTBEAT at once",
        seen=f"{answer}, {len(beat)} heartbeats",
    )
    mark = probe.mark()
    why = " (left without an answer, a QGroundControl to 5.0 falls back to MAVLink 1)"
    _expect_answer(context, PROTOCOL_VERSION, "PROTOCOL_VERSION", why)
    for heard in probe.since(mark, PROTOCOL_VERSION):
        report.expect(
            "PROTOCOL_VERSION",
            _greatest_version(bytes(heard.message.get_msgbuf())) >= MAVLINK_2_VERSION,
            expected=f"a right checksum and max_version {MAVLINK_2_VERSION} or more",
            seen=str(_greatest_version(bytes(heard.message.get_msgbuf()))),
        )
    for message_id, name in OPTIONAL.items():
        answer = probe.command(REQUEST_MESSAGE, message_id)
        report.expect(
            f"{name} on request",
            answer.result is not None,
            expected="an answer within 1 s (a real ArduPilot accepts it, but sends no message)",
            seen=f"{answer}",
        )
    answer = probe.command(REQUEST_MESSAGE, UNKNOWN_MESSAGE)
    report.expect(
        "an unknown message", answer.refused, expected="a refusal within 1 s", seen=f"{answer}"
    )
    answer = probe.command(UNKNOWN_COMMAND)
    report.expect(
        "an unknown command",
        answer.refused,
        expected="a refusal within 1 s, UNSUPPORTED (3) at best",
        seen=f"{answer}",
    )
    answer = probe.command_int(UNKNOWN_COMMAND)
    report.expect(
        "an unknown COMMAND_INT",
        answer.refused,
        expected="a refusal within 1 s (one of 1 to 4: some clients crash on 7 and above)",
        seen=f"{answer}",
    )


def check_addresses(context: Context) -> None:
    """Check acks: for the sender, once, from the target; commands to others get none."""
    probe, report = context.probe, context.report
    answer = probe.command(REQUEST_MESSAGE, AUTOPILOT_VERSION)
    targets = {(each.message.target_system, each.message.target_component) for each in answer.acks}
    report.expect(
        "ack is addressed to the sender",
        targets == {OURS},
        expected=f"target {OURS[0]}/{OURS[1]}, the sender",
        seen=", ".join(f"{system}/{component}" for system, component in targets) or f"{answer}",
    )
    sources = [each.component for each in answer.acks]
    report.expect(
        "one ack, from the target",
        sources == [AUTOPILOT],
        expected="one COMMAND_ACK from component 1 (clients match by component and command)",
        seen=f"from components {sources}" if sources else f"{answer}",
    )
    other = 1 + (probe.system_id or 0) % 250
    answer = probe.command(REQUEST_MESSAGE, AUTOPILOT_VERSION, system_id=other)
    report.expect(
        "a command for another system",
        answer.result is None,
        expected=f"silence: it was for system {other}",
        seen=f"{answer}",
    )


def check_modes_list(context: Context) -> None:
    """Request AVAILABLE_MODES, singly; a prompt refusal is acceptable, too."""
    probe, report = context.probe, context.report
    mark = probe.mark()
    answer = probe.command(REQUEST_MESSAGE, AVAILABLE_MODES, 1)
    first = probe.last(AVAILABLE_MODES)
    if first is None:
        name = "AVAILABLE_MODES"
        if not answer.refused:
            report.fail(name, expected="the modes, or a refusal within 1 s", seen=f"{answer}")
        elif context.way.needs_mode_list:
            report.note(name, f"refused ({answer}); newer ones have it")
        else:
            report.ok(name, f"refused ({answer})")
        return
    for index in range(2, first.number_modes + 1):
        probe.command(REQUEST_MESSAGE, AVAILABLE_MODES, index)
    listed = [heard.message for heard in probe.since(mark, AVAILABLE_MODES)]
    indices, numbers = [each.mode_index for each in listed], {each.custom_mode for each in listed}
    report.expect(
        "AVAILABLE_MODES",
        indices == list(range(1, first.number_modes + 1)) and len(numbers) == len(listed),
        expected=f"one of each index from 1 to {first.number_modes}, no mode twice",
        seen=f"indices {indices}",
    )
    wanted = {context.way.hold, context.way.control}
    report.expect(
        "modes that tasks need",
        wanted <= numbers,
        expected=f"custom modes {', '.join(f'{each:#x}' for each in sorted(wanted))} in the list",
        seen=", ".join(f"{each:#x}" for each in sorted(numbers)),
    )


def check_time(context: Context) -> None:
    """Check the answer to TIMESYNC."""
    probe, report = context.probe, context.report
    mark = probe.mark()
    probe.send(probe.messages.timesync_encode(0, OUR_TIME))
    found = probe.wait(TIMESYNC, COMMAND_LIMIT, since=mark, condition=lambda m: m.tc1 != 0)
    report.expect(
        "TIMESYNC",
        found is not None and found.ts1 == OUR_TIME,
        expected="its own time in tc1 (ns) and ours back in ts1, within 1 s",
        seen="silence" if found is None else f"tc1 {found.tc1}, ts1 {found.ts1}",
    )


def check_files(context: Context) -> None:
    """Check that MAVLink FTP answers with an ACK or a NAK."""
    probe, report = context.probe, context.report
    mark = probe.mark()
    probe.send(_ftp(context, 1, OPEN_FILE, b"@PARAM/no_such_file"))
    reply = probe.wait(FILE_TRANSFER, COMMAND_LIMIT, since=mark)
    code = None if reply is None else reply.payload[3]
    if code == FTP_ACK:
        probe.send(_ftp(context, 3, TERMINATE_SESSION, b"", session=reply.payload[2]))
    seen = {None: "silence", FTP_ACK: "an ACK", FTP_NAK: f"a NAK{_error(reply)}"}
    report.expect(
        "MAVLink FTP",
        code in (FTP_ACK, FTP_NAK) and (reply.target_system, reply.target_component) == OURS,
        expected="an ACK or a NAK, addressed to the sender, within 1 s",
        seen=seen.get(code, f"opcode {code}")
        + ("" if reply is None else f" to {reply.target_system}/{reply.target_component}"),
    )


def _expect_answer(context: Context, message_id: int, name: str, why: str = "") -> None:
    probe, mark = context.probe, context.probe.mark()
    answer = probe.command(REQUEST_MESSAGE, message_id)
    came = any(heard.id == message_id for heard in probe.log[mark:])
    context.report.expect(
        f"{name} on request",
        answer.refused or (answer.accepted and came),
        expected=f"the message and ACCEPTED, or a refusal, within 1 s{why}",
        seen=f"{answer}, {'the message' if came else 'no message'}",
    )


def _greatest_version(packet: bytes) -> int:
    """Return max_version of PROTOCOL_VERSION, which pymavlink cannot decode; -1: bad checksum."""
    length = packet[1]
    checked = packet[1 : HEADER_LENGTH + length] + bytes([PROTOCOL_VERSION_EXTRA])
    checksum = int.from_bytes(packet[HEADER_LENGTH + length :][:2], "little")
    if x25crc(checked).crc != checksum:
        return -1
    payload = packet[HEADER_LENGTH : HEADER_LENGTH + length].ljust(6, b"\0")
    return int.from_bytes(payload[4:6], "little")


def _ftp(context: Context, seq: int, opcode: int, data: bytes, *, session: int = 0) -> Any:
    payload = [seq & 0xFF, seq >> 8, session, opcode, len(data), 0, 0, 0, 0, 0, 0, 0, *data]
    payload += [0] * (251 - len(payload))
    return context.probe.messages.file_transfer_protocol_encode(
        0, context.probe.system_id, AUTOPILOT, payload
    )


def _error(reply: Any) -> str:
    return "" if reply is None else f" with error {reply.payload[12]}"
