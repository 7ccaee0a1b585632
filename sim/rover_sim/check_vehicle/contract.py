"""What the server and its clients rely on, and ``mav-tasks probe`` does not tell: a list of checks.

A check says what it expects, and looks. By default nothing moves or stays changed: it changes the
mode of a disarmed rover and sets it back, and sets one parameter to its present value.
"""

import asyncio
import math
from collections.abc import AsyncIterator, Awaitable, Callable, Collection
from dataclasses import dataclass
from itertools import pairwise
from struct import pack, unpack
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import development as mav

from rover_sim.check_vehicle import plans
from rover_sim.observing.driver import CUSTOM_MODE, Driver, Interference
from rover_sim.observing.observer import AUTOPILOT, PATIENCE, Observer

FIRST_HEARD, LISTENED = 10.0, 5.0  # s to wait for a rover, and to listen to it
AFTERMATH = 0.2  # s in which a duplicate answer would come
SHOWN_WITHIN = 2.0  # s until a heartbeat shows a mode or arming
ARMED_WITHIN = 15.0  # s in which a rover may still refuse after its start
LOSS_LIMIT = 0.01  # of the packets
REORDERED = 8  # packets that another one overtakes; PX4 1.17 sometimes swaps two
UNKNOWN_COMMAND, UNKNOWN_MESSAGE = 31_999, 12_000
AVAILABLE_MODES, PROTOCOL_VERSION = 435, 300
CAPABILITIES = mav.MAV_PROTOCOL_CAPABILITY_MISSION_INT | mav.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
OUR_TIME = 123_456_789_000  # ns, to be returned unchanged
OPEN_FILE, FTP_ACK, FTP_NAK = 4, 128, 129
NO_VALUE = 65535
LIST_QUIET = 1.5  # s without a new parameter end the list
ROUNDS = 3  # of reading missing ones by index
UNNUMBERED = 65535  # param_index of a change that nobody asked for
INTEGER, REAL32 = 6, 9  # MAV_PARAM_TYPE
METRES_A_DEGREE = 111_320.0


class Options(NamedTuple):
    """What a run may do to the rover."""

    arm: bool = False
    write: bool = False  # missions, fences, rally points; the previous ones are restored


@dataclass(frozen=True, slots=True)
class Make:
    """What differs between the makes, beyond what a driver needs."""

    nonsense: int  # a mode that does not exist
    takes_nonsense: bool  # answers it with ACCEPTED, and changes nothing
    is_bytewise: bool  # the float carries an integer parameter's bytes; else its value
    own_id: str  # parameters of which one shows the system id
    in_air: bool  # landed_state says IN_AIR while it is armed: QGroundControl needs that of it
    first_item: int  # of a mission; before it is home
    needed: str  # parameters without which QGroundControl asks for setup when it connects


MAKES = {
    "ardupilot": Make(
        nonsense=99,
        takes_nonsense=False,
        is_bytewise=False,
        own_id="SYSID_THISMAV MAV_SYSID",
        in_air=False,
        first_item=1,
        needed="RCMAP_ROLL RCMAP_PITCH RCMAP_THROTTLE RCMAP_YAW FRAME_CLASS COMPASS_DEV_ID "
        "COMPASS_DEV_ID2 COMPASS_DEV_ID3 INS_ACCOFFS_X INS_ACCOFFS_Y INS_ACCOFFS_Z "
        + " ".join(f"RC{n}_{limit}" for n in range(1, 5) for limit in ("MIN", "MAX", "TRIM")),
    ),
    "px4": Make(
        nonsense=99 << 16,
        takes_nonsense=True,  # 1.17
        is_bytewise=True,
        own_id="MAV_SYS_ID",
        in_air=True,
        first_item=0,
        needed="SYS_AUTOSTART COM_RC_IN_MODE CAL_GYRO0_ID CAL_ACC0_ID SYS_HAS_MAG _HASH_CHECK",
    ),
}
MAKES["generic"] = Make(99 << 16, True, True, "MAV_SYS_ID", in_air=True, first_item=0, needed="")


class Seen(NamedTuple):
    """What a check has seen; ``is_right`` None: it could not look."""

    is_right: bool | None
    words: object


@dataclass
class Rover:
    """The rover that is checked."""

    observer: Observer
    driver: Driver
    options: Options

    @property
    def make(self) -> Make:
        """Its conventions."""
        return MAKES[self.driver.make.name]

    async def asked(self, number: int, *params: float) -> Seen:
        """Ask a command; right is an acceptance."""
        answer = await self.observer.command(number, *params)
        return Seen(answer.is_accepted, answer)


Look = Callable[[Rover], Awaitable[Seen]]


class Check(NamedTuple):
    """One check."""

    group: str
    name: str
    expected: str
    look: Look


# looks that several checks share


def refused(number: int, *params: float) -> Look:
    """Return a look at a command that must be refused: silence costs a client seconds."""

    async def look(rover: Rover) -> Seen:
        answer = await rover.observer.command(number, *params)
        return Seen(answer.is_refused, answer)

    return look


def answered(message_id: int) -> Look:
    """Return a look at a request for a message: it comes, or is refused."""

    async def look(rover: Rover) -> Seen:
        mark = len(rover.observer.log)
        answer = await rover.observer.command(mav.MAV_CMD_REQUEST_MESSAGE, message_id)
        came = any(each.packet.message_id == message_id for each in rover.observer.log[mark:])
        words = f"{answer}, {'the' if came else 'no'} message"
        return Seen(answer.is_refused or (answer.is_accepted and came), words)

    return look


def message(name: str, holds: Callable[[Any, Make], object]) -> Look:
    """Return a look at the last copy of a message, which is requested if it has not come."""

    async def look(rover: Rover) -> Seen:
        found = await last(rover, name)
        if found is None:
            return Seen(False, "neither streamed nor sent on request")
        right = bool(holds(found, rover.make))
        return Seen(right, "as expected" if right else found)

    return look


async def last(rover: Rover, name: str) -> Any:
    """Return the last message of this name, which is requested if it has not come, or None."""
    found = rover.observer.message(name)
    if found is None:
        number = getattr(mav, f"MAVLINK_MSG_ID_{name}")
        await rover.observer.command(mav.MAV_CMD_REQUEST_MESSAGE, number)
        await rover.observer.until(lambda: rover.observer.message(name), AFTERMATH)
    return rover.observer.message(name)


# identity and packets


async def heartbeats(rover: Rover) -> Seen:
    """Listen for a while."""
    mark = len(rover.observer.log)
    await asyncio.sleep(LISTENED)
    count = len(rover.observer.since(mark, "HEARTBEAT"))
    return Seen(LISTENED - 1.5 <= count <= LISTENED + 1.5, f"{count} in {LISTENED:g} s")


async def by_command_int(rover: Rover) -> Seen:
    """Ask by COMMAND_INT."""
    filled = (float(mav.MAVLINK_MSG_ID_AUTOPILOT_VERSION), 0.0, 0.0, 0.0)
    answer = await rover.observer.ask(
        rover.observer.out.command_int_encode(
            *(rover.observer.system, AUTOPILOT, 0, mav.MAV_CMD_REQUEST_MESSAGE, 0, 0),
            *(*filled, 0, 0, 0.0),
        )
    )
    return Seen(answer.is_accepted, answer)


async def whole_packets(rover: Rover) -> Seen:
    """Look at every packet of the whole run."""
    packets = [heard.packet for heard in rover.observer.log if heard.packet.source[1] == AUTOPILOT]
    ahead = [(after.seq - before.seq) % 256 for before, after in pairwise(packets)]
    lost = sum(each - 1 for each in ahead if each <= 256 - REORDERED)
    lost -= sum(each > 256 - REORDERED for each in ahead)
    old, damaged = sum(not each.is_v2 for each in packets), rover.observer.damaged
    words = f"{lost} missing, {damaged} damaged, {old} of MAVLink 1, of {len(packets)}"
    return Seen(max(lost, damaged) <= LOSS_LIMIT * len(packets) and not old, words)


# telemetry


def on_earth(m: Any) -> bool:
    """Return whether a place in degrees × 10⁷ is one."""
    latitude, longitude = getattr(m, "latitude", None), getattr(m, "longitude", None)
    latitude = m.lat if latitude is None else latitude
    longitude = m.lon if longitude is None else longitude
    return abs(latitude) <= 90e7 and abs(longitude) <= 180e7 and (latitude, longitude) != (0, 0)


async def one_heading(rover: Rover) -> Seen:
    """Compare two messages."""
    attitude, place = await last(rover, "ATTITUDE"), await last(rover, "GLOBAL_POSITION_INT")
    if attitude is None or place is None or place.hdg == NO_VALUE:
        return Seen(None, "no ATTITUDE, or no heading in GLOBAL_POSITION_INT")
    yaw, heading = math.degrees(attitude.yaw), place.hdg / 100
    off = abs(math.remainder(yaw - heading, 360.0))
    return Seen(off <= 10.0, f"{yaw:.1f}° and {heading:.1f}°")


async def one_place(rover: Rover) -> Seen:
    """Compare two messages."""
    raw, place = await last(rover, "GPS_RAW_INT"), await last(rover, "GLOBAL_POSITION_INT")
    if raw is None or place is None:
        return Seen(None, "no GPS_RAW_INT, or no GLOBAL_POSITION_INT")
    north, east = (raw.lat - place.lat) * 1e-7, (raw.lon - place.lon) * 1e-7
    east *= math.cos(math.radians(place.lat * 1e-7))
    apart = math.hypot(north, east) * METRES_A_DEGREE
    return Seen(apart < 50.0, f"{apart:.1f} m apart")


async def boot_times(rover: Rover) -> Seen:
    """Compare time_boot_ms with our clock."""
    rows = rover.observer.since(0, "ATTITUDE") or rover.observer.since(0, "SYSTEM_TIME")
    if len(rows) < 2:
        return Seen(None, "too few messages with time_boot_ms")
    times = [each.message.time_boot_ms for each in rows]
    pace = (times[-1] - times[0]) / max(rows[-1].at - rows[0].at, 1e-6)
    right = times == sorted(times) and 700 < pace < 1300
    return Seen(right, f"{pace:.0f} a second")


async def told_interval(rover: Rover) -> Seen:
    """Set a rate, and read it back; then restore it."""
    observer, attitude = rover.observer, float(mav.MAVLINK_MSG_ID_ATTITUDE)

    async def told() -> int | None:
        answer = await observer.command(mav.MAV_CMD_GET_MESSAGE_INTERVAL, attitude)
        found = observer.message("MESSAGE_INTERVAL") if answer.is_accepted else None
        return None if found is None else int(found.interval_us)

    before = await told()
    await rover.driver.ask_rates(20.0, int(attitude))
    after = await told()
    await observer.command(mav.MAV_CMD_SET_MESSAGE_INTERVAL, attitude, float(before or 0))
    return Seen(after is not None and abs(after - 50_000) < 15_000, f"{after} µs")


# answers


async def one_ack(rover: Rover) -> Seen:
    """Look at the acknowledgements of one command."""
    observer, mark = rover.observer, len(rover.observer.log)
    await observer.command(mav.MAV_CMD_REQUEST_MESSAGE, mav.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
    await asyncio.sleep(AFTERMATH)
    acks = [
        (heard.packet.source[1], heard.message.target_system, heard.message.target_component)
        for heard in observer.since(mark, "COMMAND_ACK")
    ]
    ours = (AUTOPILOT, observer.out.srcSystem, observer.out.srcComponent)
    return Seen(acks == [ours], f"(from, to system, to component): {acks}")


async def for_others(rover: Rover) -> Seen:
    """Ask something of another system."""
    number, wanted = mav.MAV_CMD_REQUEST_MESSAGE, mav.MAVLINK_MSG_ID_AUTOPILOT_VERSION
    answer = await rover.observer.command(number, wanted, system=1 + rover.observer.system % 250)
    return Seen(answer.result is None, answer)


async def modes_list(rover: Rover) -> Seen:
    """Ask for the modes one by one; a prompt refusal is right, too."""
    observer, mark = rover.observer, len(rover.observer.log)
    answer = await observer.command(mav.MAV_CMD_REQUEST_MESSAGE, AVAILABLE_MODES, 1)
    await asyncio.sleep(AFTERMATH)
    first = observer.message("AVAILABLE_MODES")
    if first is None:
        return Seen(answer.is_refused, answer)
    for index in range(2, first.number_modes + 1):
        await observer.command(mav.MAV_CMD_REQUEST_MESSAGE, AVAILABLE_MODES, index)
    await asyncio.sleep(AFTERMATH)
    listed = [heard.message for heard in observer.since(mark, "AVAILABLE_MODES")]
    numbers = {each.custom_mode for each in listed}
    right = [each.mode_index for each in listed] == list(range(1, first.number_modes + 1))
    right = right and {rover.driver.make.hold, rover.driver.make.control} <= numbers
    return Seen(
        right, f"{len(listed)} modes: {', '.join(f'{each:#x}' for each in sorted(numbers))}"
    )


async def time_sync(rover: Rover) -> Seen:
    """Ask for its time."""
    rover.observer.send(rover.observer.out.timesync_encode(0, OUR_TIME))
    found = await rover.observer.wait("TIMESYNC", PATIENCE, lambda m: m.tc1 != 0)
    return Seen(found is not None and found.ts1 == OUR_TIME, found or "silence")


async def file_transfer(rover: Rover) -> Seen:
    """Ask for a file that does not exist."""
    observer, name = rover.observer, b"@PARAM/no_such_file"
    payload = [1, 0, 0, OPEN_FILE, len(name), *(0,) * 7, *name]
    payload += [0] * (251 - len(payload))
    observer.send(
        observer.out.file_transfer_protocol_encode(0, observer.system, AUTOPILOT, payload)
    )
    reply = await observer.wait("FILE_TRANSFER_PROTOCOL", PATIENCE)
    right = reply is not None and reply.payload[3] in (FTP_ACK, FTP_NAK)
    return Seen(right, "silence" if reply is None else f"opcode {reply.payload[3]}")


# parameters


async def read_list(rover: Rover) -> Seen:
    """Read the whole list, and what is missing by index."""
    observer, mark = rover.observer, len(rover.observer.log)
    observer.send(observer.out.param_request_list_encode(observer.system, AUTOPILOT))
    while await observer.wait("PARAM_VALUE", LIST_QUIET):
        pass
    listed = parameters(rover, mark)
    counts = {each.param_count for each in listed.values()}
    if len(counts) != 1:
        return Seen(False, f"{len(listed)} parameters, param_count {counts}")
    for _ in range(ROUNDS):
        for index in set(range(*counts)) - {each.param_index for each in listed.values()}:
            await read(rover, "", index)
        listed = parameters(rover, mark)
    indices = {each.param_index for each in listed.values()}
    missing = sorted(set(range(*counts)) - indices)
    words = f"{len(listed)} names, {len(indices)} indices of {max(counts)}, missing {missing[:9]}"
    return Seen(len(listed) == len(indices) == max(counts), words)


def parameters(rover: Rover, mark: int = 0) -> dict[str, Any]:
    """Return those of the list by name.

    ArduPilot sends parameters that it changes itself without an index (4.6.3), PX4 _HASH_CHECK.
    """
    rows = (heard.message for heard in rover.observer.since(mark, "PARAM_VALUE"))
    return {row.param_id: row for row in rows if row.param_index != UNNUMBERED}


async def read(rover: Rover, name: str, index: int = -1) -> Any:
    """Return a parameter that is read by its name or index, or None."""
    observer = rover.observer
    observer.send(
        observer.out.param_request_read_encode(observer.system, AUTOPILOT, name.encode(), index)
    )
    return await observer.wait(
        "PARAM_VALUE",
        PATIENCE,
        lambda m: m.param_id == name if index < 0 else m.param_index == index,
    )


async def single_reads(rover: Rover) -> Seen:
    """Read the first parameter by its name and by its index, and set a float to what it is."""
    listed = parameters(rover)
    real = next((each for each in listed.values() if each.param_type == REAL32), None)
    if real is None:
        return Seen(None, "there is no parameter of type REAL32")
    found = [await read(rover, real.param_id), await read(rover, "", real.param_index)]
    observer, name = rover.observer, real.param_id
    observer.send(
        observer.out.param_set_encode(
            observer.system, AUTOPILOT, name.encode(), real.param_value, REAL32
        )
    )
    found.append(await observer.wait("PARAM_VALUE", PATIENCE, lambda m: m.param_id == name))
    right = all(each is not None and each.param_value == real.param_value for each in found)
    return Seen(right, [each and (each.param_id, each.param_value) for each in found])


async def encoding(rover: Rover) -> Seen:
    """Read the system id out of its parameter."""
    listed = parameters(rover)
    own = next((listed[name] for name in rover.make.own_id.split() if name in listed), None)
    if own is None:
        return Seen(None, f"no {rover.make.own_id}")
    value = own.param_value
    if rover.make.is_bytewise and own.param_type != REAL32:
        (value,) = unpack("<i", pack("<f", value))
    return Seen(value == rover.observer.system, f"{own.param_id} {value!r}")


async def needed_parameters(rover: Rover) -> Seen:
    """Look for what QGroundControl needs; a checksum of the list counts as listed."""
    names = {heard.message.param_id for heard in rover.observer.since(0, "PARAM_VALUE")}
    if "_HASH_CHECK" in rover.make.needed and await read(rover, "_HASH_CHECK"):
        names.add("_HASH_CHECK")
    missing = set(rover.make.needed.split()) - names
    return Seen(not missing, f"missing {sorted(missing)}" if missing else "all there")


# modes and arming


def enters(name: str) -> Look:
    """Return a look at a mode, an attribute of the driver's make; the present one is restored."""

    async def look(rover: Rover) -> Seen:
        driver = rover.driver
        if driver.is_armed:
            return Seen(None, "it is armed: changing its mode could move it")
        before, mode = driver.mode, getattr(driver.make, name)
        if driver.make.in_parts and name == "control":
            await driver.zeros(1.0)
        answer = await driver.set_mode(mode)
        shown = await rover.observer.until(lambda: driver.mode == mode, SHOWN_WITHIN)
        seen = Seen(answer.is_accepted and shown, f"{answer}, mode {driver.mode:#x}")
        await driver.set_mode(before)
        await rover.observer.until(lambda: driver.mode == before, SHOWN_WITHIN)
        return seen

    return look


async def nonsense(rover: Rover) -> Seen:
    """Ask for a mode that does not exist."""
    before = rover.driver.mode
    answer = await rover.driver.set_mode(rover.make.nonsense)
    await rover.observer.wait("HEARTBEAT", SHOWN_WITHIN)
    right = answer.is_refused or (answer.is_accepted and rover.make.takes_nonsense)
    return Seen(right and rover.driver.mode == before, f"{answer}, mode {rover.driver.mode:#x}")


async def old_message(rover: Rover) -> Seen:
    """Ask for HOLD by SET_MODE, as QGroundControl does of PX4; then restore the mode."""
    observer, driver = rover.observer, rover.driver
    before, hold = driver.mode, driver.make.hold
    observer.send(observer.out.set_mode_encode(observer.system, CUSTOM_MODE, hold))
    shown = await observer.until(lambda: driver.mode == hold, SHOWN_WITHIN)
    seen = Seen(shown, f"mode {driver.mode:#x}")
    await driver.set_mode(before)
    return seen


async def arms(rover: Rover) -> Seen:
    """Arm in HOLD, and disarm."""
    driver, observer = rover.driver, rover.observer
    if not rover.options.arm or driver.is_armed:
        return Seen(None, "needs --arm, and a rover that is disarmed")
    await driver.hold()
    end, answer = observer.now + ARMED_WITHIN, await driver.arm()
    while not answer.is_accepted and observer.now < end:
        await asyncio.sleep(1.0)
        answer = await driver.arm()
    armed = await observer.until(lambda: driver.is_armed, SHOWN_WITHIN)
    state = await last(rover, "EXTENDED_SYS_STATE")
    if armed and rover.make.in_air:
        await observer.until(lambda: _landed_state(rover) == mav.MAV_LANDED_STATE_IN_AIR, 2.5)
        state = observer.message("EXTENDED_SYS_STATE")
    flies = state is not None and state.landed_state == mav.MAV_LANDED_STATE_IN_AIR
    rested = await driver.rest()
    words = f"{answer}, {'' if armed else 'not '}shown, {'' if rested else 'not '}at rest again"
    right = answer.is_accepted and armed and rested and (flies or not rover.make.in_air)
    return Seen(right, words if flies or not rover.make.in_air else f"{words}, not IN_AIR")


def _landed_state(rover: Rover) -> int:
    state = rover.observer.message("EXTENDED_SYS_STATE")
    return -1 if state is None else int(state.landed_state)


def plan_of(kind: int) -> Look:
    """Return a look at a plan: it is downloaded; with ``write`` another one is uploaded, too."""

    async def look(rover: Rover) -> Seen:
        first = rover.make.first_item if kind == mav.MAV_MISSION_TYPE_MISSION else 0
        place = await last(rover, "GLOBAL_POSITION_INT")
        around = (0, 0) if place is None else (place.lat, place.lon)
        may_write = rover.options.write
        try:
            return Seen(
                True, await plans.check(rover.observer, kind, around, first, may_write=may_write)
            )
        except plans.Wrong as error:
            return Seen(False, error)

    return look


REQUEST, INTERVAL = mav.MAV_CMD_REQUEST_MESSAGE, mav.MAV_CMD_SET_MESSAGE_INTERVAL
AN_ANSWER = "the message and ACCEPTED, or a refusal, within 1 s"
CHECKS = (
    Check("identity", "heartbeat rate", "1 Hz", heartbeats),
    Check(
        "identity",
        "heartbeat",
        "a rover or boat, base_mode with CUSTOM_MODE_ENABLED, a MAV_STATE from 1 to 8",
        message(
            "HEARTBEAT",
            lambda m, _: m.type in (10, 11) and m.base_mode & 1 and 1 <= m.system_status <= 8,
        ),
    ),
    Check(
        "identity",
        "AUTOPILOT_VERSION",
        "it, with MISSION_INT and COMMAND_INT: clients wait for it before all else",
        message("AUTOPILOT_VERSION", lambda m, _: m.capabilities & CAPABILITIES == CAPABILITIES),
    ),
    Check("identity", "COMMAND_INT", "ACCEPTED, as by COMMAND_LONG", by_command_int),
    Check(
        "telemetry",
        "SYS_STATUS",
        "voltage in mV (65535 unknown), -1 to 100 % left, load in 0.1 %",
        message(
            "SYS_STATUS",
            lambda m, _: (
                m.load <= 1000 and -1 <= m.battery_remaining <= 100 and m.voltage_battery >= 1000
            ),
        ),
    ),
    Check(
        "telemetry",
        "EXTENDED_SYS_STATE",
        "landed_state 1 to 4; an ArduPilot Rover sends 0 (4.6.3)",
        message("EXTENDED_SYS_STATE", lambda m, make: make.in_air <= m.landed_state <= 4),
    ),
    Check(
        "telemetry",
        "ATTITUDE",
        "angles in rad, within ±π",
        message("ATTITUDE", lambda m, _: max(map(abs, (m.roll, m.pitch, m.yaw))) < 3.143),
    ),
    Check(
        "telemetry",
        "LOCAL_POSITION_NED",
        "metres from the origin, m/s",
        message(
            "LOCAL_POSITION_NED",
            lambda m, _: math.hypot(m.x, m.y) < 1e5 and math.hypot(m.vx, m.vy) < 50,
        ),
    ),
    Check(
        "telemetry",
        "GLOBAL_POSITION_INT",
        "degrees × 10⁷, not 0/0; heading in 0.01° (65535 unknown)",
        message(
            "GLOBAL_POSITION_INT",
            lambda m, _: on_earth(m) and (m.hdg == NO_VALUE or m.hdg < 36000),
        ),
    ),
    Check(
        "telemetry",
        "GPS_RAW_INT",
        "a 3D fix at a place on Earth",
        message("GPS_RAW_INT", lambda m, _: m.fix_type >= 3 and on_earth(m)),
    ),
    Check(
        "telemetry",
        "VFR_HUD",
        "heading 0 to 360°, speed in m/s; a PX4 rover's airspeed is not a number (1.17)",
        message("VFR_HUD", lambda m, _: 0 <= m.heading <= 360 and abs(m.groundspeed) < 50),
    ),
    Check(
        "telemetry", "HOME_POSITION", "a place", message("HOME_POSITION", lambda m, _: on_earth(m))
    ),
    Check(
        "telemetry",
        "BATTERY_STATUS",
        "voltages in mV, -1 to 100 % left",
        message(
            "BATTERY_STATUS",
            lambda m, _: m.voltages[0] >= 1000 and -1 <= m.battery_remaining <= 100,
        ),
    ),
    Check("telemetry", "one heading", "ATTITUDE and GLOBAL_POSITION_INT within 10°", one_heading),
    Check("telemetry", "one place", "GPS_RAW_INT, GLOBAL_POSITION_INT within 50 m", one_place),
    Check("telemetry", "boot times", "time_boot_ms: never back, 1,000 a second", boot_times),
    Check("rates", "GET_MESSAGE_INTERVAL", "50,000 µs, as was set", told_interval),
    Check(
        "rates",
        "interval of an unknown message",
        "a refusal",
        refused(INTERVAL, UNKNOWN_MESSAGE, 1e6),
    ),
    Check("answers", "HEARTBEAT on request", AN_ANSWER, answered(mav.MAVLINK_MSG_ID_HEARTBEAT)),
    Check(
        "answers",
        "PROTOCOL_VERSION on request",
        f"{AN_ANSWER}; after silence a QGroundControl to 5.0 falls back to MAVLink 1",
        answered(PROTOCOL_VERSION),
    ),
    Check("answers", "an unknown message", "a refusal", refused(REQUEST, UNKNOWN_MESSAGE)),
    Check("answers", "an unknown command", "a refusal", refused(UNKNOWN_COMMAND)),
    Check("answers", "acknowledgement", "one, from the target, to the sender", one_ack),
    Check("answers", "a command for another system", "silence", for_others),
    Check("answers", "AVAILABLE_MODES", "each once, with those that tasks need", modes_list),
    Check("answers", "TIMESYNC", "its time in tc1, ours back in ts1", time_sync),
    Check("answers", "MAVLink FTP", "an ACK or a NAK", file_transfer),
    Check("parameters", "list", "each index once, each name once, one param_count", read_list),
    Check(
        "parameters",
        "read and set",
        "the listed value by name, by index, after setting",
        single_reads,
    ),
    Check("parameters", "encoding", "the system id, in the way of its make", encoding),
    Check("parameters", "for QGroundControl", "all that it needs to connect", needed_parameters),
    *(
        Check("plans", name, "as it was uploaded", plan_of(kind))
        for kind, name in ((0, "mission"), (1, "fence"), (2, "rally points"))
    ),
    Check("modes", "enter HOLD", "ACCEPTED, and shown", enters("hold")),
    Check("modes", "enter the control mode", "ACCEPTED, and shown", enters("control")),
    Check("modes", "a mode that does not exist", "an answer, and the same mode", nonsense),
    Check("modes", "SET_MODE message", "HOLD, shown", old_message),
    Check("arming", "arm and disarm", "ACCEPTED and shown; IN_AIR if it is a PX4", arms),
    Check("packets", "all of them", "MAVLink 2, in sequence, whole", whole_packets),
)
GROUPS = tuple(dict.fromkeys(check.group for check in CHECKS))


async def check_all(
    observer: Observer, options: Options, only: Collection[str] = GROUPS
) -> AsyncIterator[tuple[Check, Seen]]:
    """Yield the checks of the groups with what they have seen. Raise Interference."""
    if not await observer.found(FIRST_HEARD):
        raise Interference(f"no heartbeat of a rover within {FIRST_HEARD:g} s")
    rover = Rover(observer, Driver(observer), options)
    for check in CHECKS:
        if check.group in only:
            yield check, await check.look(rover)
