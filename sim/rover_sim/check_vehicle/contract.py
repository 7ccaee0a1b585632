"""What the server and its clients rely on, and ``mav-tasks probe`` does not tell.

contract.csv has the checks: how each looks (a function of this file), with what, and what is
expected. By default nothing moves or stays changed: the mode of a disarmed rover is changed and set
back, and one parameter is set to its present value.
"""

import asyncio
import csv
import math
from collections.abc import AsyncIterator, Collection
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from struct import pack, unpack
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import development as mav

from rover_sim.check_vehicle import plans
from rover_sim.observing.driver import CUSTOM_MODE, Driver, Interference
from rover_sim.observing.observer import AUTOPILOT, PATIENCE, Observer

FIRST_HEARD = 10.0  # s to wait for a rover
LISTENED = 3.0  # s
AFTERMATH = 0.2  # s in which a duplicate answer would come
SHOWN_WITHIN = 2.5  # s until a heartbeat shows a mode or arming
ARMED_WITHIN = 15.0  # s in which a rover may still refuse after its start
LOSS_LIMIT = 0.01  # of the packets
REORDERED = 8  # packets that another one overtakes; PX4 1.17 sometimes swaps two
LIST_QUIET = 1.5  # s without a new parameter end the list
ROUNDS = 3  # of reading missing ones by index
UNNUMBERED = 65535  # param_index of a change that nobody asked for
REAL32 = 9  # MAV_PARAM_TYPE
REQUEST, VERSION = mav.MAV_CMD_REQUEST_MESSAGE, mav.MAVLINK_MSG_ID_AUTOPILOT_VERSION
IN_AIR = mav.MAV_LANDED_STATE_IN_AIR


class Options(NamedTuple):
    """What a run may do to the rover."""

    arm: bool = False
    write: bool = False  # missions, fences, rally points; the previous ones are restored


NONSENSE = 99  # a mode that does not exist; of PX4 a main mode
OWN_ID = "SYSID_THISMAV MAV_SYSID MAV_SYS_ID"  # parameters of which one shows the system id
RC_LIMITS = [f"RC{n}_{limit}" for n in range(1, 5) for limit in ("MIN", "MAX", "TRIM")]
#: parameters without which QGroundControl asks for setup when it connects, by make
NEEDED = {
    "ardupilot": "RCMAP_ROLL RCMAP_PITCH RCMAP_THROTTLE RCMAP_YAW FRAME_CLASS COMPASS_DEV_ID "
    "COMPASS_DEV_ID2 COMPASS_DEV_ID3 INS_ACCOFFS_X INS_ACCOFFS_Y INS_ACCOFFS_Z "
    + " ".join(RC_LIMITS),
    "px4": "SYS_AUTOSTART COM_RC_IN_MODE CAL_GYRO0_ID CAL_ACC0_ID SYS_HAS_MAG _HASH_CHECK",
}


class Seen(NamedTuple):
    """What a check has seen; ``is_right`` None: it could not look."""

    is_right: bool | None
    words: object


class Check(NamedTuple):
    """One check, as contract.csv has it."""

    group: str
    name: str
    look: str
    arguments: str
    expected: str


def _checks() -> tuple[Check, ...]:
    with Path(__file__).with_suffix(".csv").open(encoding="utf-8", newline="") as file:
        return tuple(Check(*row.values()) for row in csv.DictReader(file))


CHECKS = _checks()
GROUPS = tuple(dict.fromkeys(check.group for check in CHECKS))


@dataclass
class Rover:
    """The rover that is checked; each public coroutine is a look."""

    observer: Observer
    driver: Driver
    options: Options

    @property
    def _is_px4(self) -> bool:
        """Whether, as PX4 1.17, it has integers by bytes, IN_AIR if armed, and accepts any mode."""
        return self.driver.make.is_px4

    @property
    def _target(self) -> tuple[int, int]:
        return self.observer.system, AUTOPILOT

    async def _last(self, name: str) -> Any:
        """Return the last message of this name, which is requested if it has not come, or None."""
        if self.observer.message(name) is None:
            await self.observer.command(REQUEST, getattr(mav, f"MAVLINK_MSG_ID_{name}"))
            await self.observer.until(lambda: self.observer.message(name), AFTERMATH)
        return self.observer.message(name)

    async def within(self, name: str, field: str, least: str, most: str) -> Seen:
        """Look at a field of a message."""
        message = await self._last(name)
        value = math.nan if message is None else getattr(message, field)
        right = float(least) <= value <= float(most) and value is not None
        return Seen(right, value if message else f"no {name}, neither streamed nor on request")

    async def one_heading(self) -> Seen:
        """Compare two messages."""
        attitude, place = await self._last("ATTITUDE"), await self._last("GLOBAL_POSITION_INT")
        if attitude is None or place is None or place.hdg == UNNUMBERED:
            return Seen(None, "no ATTITUDE, or no heading in GLOBAL_POSITION_INT")
        yaw, heading = math.degrees(attitude.yaw), place.hdg / 100
        off = abs(math.remainder(yaw - heading, 360.0))
        return Seen(off <= 10.0, f"{yaw:.1f}° and {heading:.1f}°")

    async def streams(self, hertz: str) -> Seen:
        """Ask for ATTITUDE at a rate; compare its time_boot_ms with our clock."""
        mark, rate = len(self.observer.log), float(hertz)
        await self.driver.ask_rates(rate, mav.MAVLINK_MSG_ID_ATTITUDE)
        await asyncio.sleep(LISTENED)
        rows = self.observer.since(mark, "ATTITUDE")
        await self.driver.ask_rates(0.0, mav.MAVLINK_MSG_ID_ATTITUDE)
        if len(rows) < 2:
            return Seen(False, f"{len(rows)} in {LISTENED:g} s")
        times, seconds = [each.message.time_boot_ms for each in rows], rows[-1].at - rows[0].at
        seen, pace = (len(rows) - 1) / seconds, (times[-1] - times[0]) / seconds
        right = 0.7 < seen / rate < 1.3 and 700 < pace < 1300 and times == sorted(times)
        return Seen(right, f"{seen:.1f} Hz, {pace:.0f} ms of its clock a second")

    # answers

    async def refused(self, *numbers: str) -> Seen:
        """Ask a command that must be refused: silence costs a client seconds."""
        command, *params = map(float, numbers)
        answer = await self.observer.command(int(command), *params)
        return Seen(answer.is_refused, answer)

    async def answered(self, message_id: str) -> Seen:
        """Ask for a message, which comes or is refused."""
        mark = len(self.observer.log)
        answer = await self.observer.command(REQUEST, float(message_id))
        await asyncio.sleep(AFTERMATH)
        ids = [each.packet.message_id for each in self.observer.log[mark:]]
        came = int(message_id) in ids
        words = f"{answer}, {'the' if came else 'no'} message"
        return Seen(answer.is_refused or (answer.is_accepted and came), words)

    async def by_command_int(self) -> Seen:
        """Ask by COMMAND_INT."""
        fields = (0, REQUEST, 0, 0, float(VERSION), 0.0, 0.0, 0.0, 0, 0, 0.0)
        answer = await self.observer.ask(
            self.observer.out.command_int_encode(*self._target, *fields)
        )
        return Seen(answer.is_accepted, answer)

    async def one_ack(self) -> Seen:
        """Look at the acknowledgements of one command."""
        out, mark = self.observer.out, len(self.observer.log)
        await self.observer.command(REQUEST, VERSION)
        await asyncio.sleep(AFTERMATH)
        acks = [
            (each.packet.component_id, each.message.target_system, each.message.target_component)
            for each in self.observer.since(mark, "COMMAND_ACK")
        ]
        right = acks == [(AUTOPILOT, out.srcSystem, out.srcComponent)]
        return Seen(right, f"(from, to system, to component): {acks}")

    async def for_others(self) -> Seen:
        """Ask something of another system."""
        other = 1 + self.observer.system % 250
        answer = await self.observer.command(REQUEST, VERSION, system=other)
        return Seen(answer.result is None, answer)

    # parameters

    def _parameters(self) -> dict[str, Any]:
        """Return those of the list by name.

        ArduPilot sends parameters that it changes itself without an index (4.6.3), PX4 its
        _HASH_CHECK.
        """
        rows = (heard.message for heard in self.observer.since(0, "PARAM_VALUE"))
        return {row.param_id: row for row in rows if row.param_index != UNNUMBERED}

    async def _read(self, name: str, index: int = -1) -> Any:
        """Return a parameter that is read by its name or index, or None."""
        out = self.observer.out
        self.observer.send(out.param_request_read_encode(*self._target, name.encode(), index))
        return await self.observer.wait(
            "PARAM_VALUE", PATIENCE, lambda m: name == m.param_id or index == m.param_index
        )

    async def read_list(self) -> Seen:
        """Read the whole list, and what is missing by index."""
        self.observer.send(self.observer.out.param_request_list_encode(*self._target))
        while await self.observer.wait("PARAM_VALUE", LIST_QUIET):
            pass
        counts = {each.param_count for each in self._parameters().values()}
        wanted, indices = set(range(max(counts, default=0))), set[int]()
        for _ in range(ROUNDS):
            indices = {each.param_index for each in self._parameters().values()}
            for index in wanted - indices:
                await self._read("", index)
        names, missing = len(self._parameters()), sorted(wanted - indices)
        right = len(counts) == 1 and bool(wanted) and indices == wanted and names == len(wanted)
        return Seen(right, f"{names} names of {counts}, missing {missing[:9]}")

    async def single_reads(self) -> Seen:
        """Read one by its name and by its index, and set it, a float, to what it is."""
        reals = (each for each in self._parameters().values() if each.param_type == REAL32)
        real = next(reals, None)
        if real is None:
            return Seen(None, "there is no parameter of type REAL32")
        name, value = real.param_id, real.param_value
        found = [await self._read(name), await self._read("", real.param_index)]
        out = self.observer.out
        self.observer.send(out.param_set_encode(*self._target, name.encode(), value, REAL32))
        found.append(
            await self.observer.wait("PARAM_VALUE", PATIENCE, lambda m: m.param_id == name)
        )
        values = [None if each is None else each.param_value for each in found]
        return Seen(values == [value] * 3, f"{name} {values}")

    async def encoding(self) -> Seen:
        """Read the system id out of its parameter."""
        listed = self._parameters()
        own = next((listed[name] for name in OWN_ID.split() if name in listed), None)
        if own is None:
            return Seen(None, f"no {OWN_ID}")
        value = own.param_value
        if self._is_px4 and own.param_type != REAL32:
            (value,) = unpack("<i", pack("<f", value))
        return Seen(value == self.observer.system, f"{own.param_id} {value!r}")

    async def needed(self) -> Seen:
        """Look for what QGroundControl needs; a checksum of the list is not in it."""
        needed = NEEDED.get(self.driver.make.name, "")
        missing = [name for name in needed.split() if name not in self._parameters()]
        missing = [name for name in missing if await self._read(name) is None]
        return Seen(not missing, f"missing: {missing}")

    async def plan(self, kind: str) -> Seen:
        """Download a plan; with ``write`` upload another one, compare, clear and restore."""
        first = int(kind == "0" and not self._is_px4)  # before it is home
        place = await self._last("GLOBAL_POSITION_INT")
        around = (0, 0) if place is None else (place.lat, place.lon)
        may_write = self.options.write
        try:
            return Seen(True, await plans.check(self.observer, int(kind), around, first, may_write))
        except plans.Wrong as error:
            return Seen(False, error)

    # modes and arming

    async def enters(self, name: str) -> Seen:
        """Enter a mode of the driver's make; restore the present one."""
        driver = self.driver
        if driver.is_armed:
            return Seen(None, "it is armed: changing its mode could move it")
        before, mode = driver.mode, getattr(driver.make, name)
        try:
            if driver.make.is_px4 and name == "control":
                await driver.zeros(1.0)
            answer = await driver.set_mode(mode)
            shown = await self.observer.until(lambda: driver.mode == mode, SHOWN_WITHIN)
            return Seen(answer.is_accepted and shown, f"{answer}, mode {driver.mode:#x}")
        finally:
            await driver.set_mode(before)
            await self.observer.until(lambda: driver.mode == before, SHOWN_WITHIN)

    async def nonsense(self) -> Seen:
        """Ask for a mode that does not exist."""
        before = self.driver.mode
        answer = await self.driver.set_mode(NONSENSE << 16 if self._is_px4 else NONSENSE)
        await self.observer.wait("HEARTBEAT", SHOWN_WITHIN)
        right = answer.is_refused or (answer.is_accepted and self._is_px4)
        words = f"{answer}, mode {self.driver.mode:#x}"
        return Seen(right and self.driver.mode == before, words)

    async def old_message(self) -> Seen:
        """Ask for HOLD by SET_MODE, as QGroundControl does of PX4; then restore the mode."""
        driver, before, hold = self.driver, self.driver.mode, self.driver.make.hold
        self.observer.send(
            self.observer.out.set_mode_encode(self.observer.system, CUSTOM_MODE, hold)
        )
        shown = await self.observer.until(lambda: driver.mode == hold, SHOWN_WITHIN)
        seen = Seen(shown, f"mode {driver.mode:#x}")
        await driver.set_mode(before)
        return seen

    async def arms(self) -> Seen:
        """Arm in HOLD, and disarm."""
        driver = self.driver
        if not self.options.arm or driver.is_armed:
            return Seen(None, "needs --arm, and a rover that is disarmed")
        await driver.hold()

        def shown() -> bool:
            state = self.observer.message("EXTENDED_SYS_STATE")
            flies = state is not None and state.landed_state == IN_AIR
            return driver.is_armed and (flies or not self._is_px4)

        try:
            end, answer = self.observer.now + ARMED_WITHIN, await driver.arm()
            while not answer.is_accepted and self.observer.now < end:
                await asyncio.sleep(1.0)
                answer = await driver.arm()
            armed = await self.observer.until(shown, SHOWN_WITHIN)
        finally:
            rested = await driver.rest()
        words = f"{answer}, {'' if armed else 'not '}shown, {'' if rested else 'not '}at rest again"
        return Seen(answer.is_accepted and armed and rested, words)

    async def whole_packets(self) -> Seen:
        """Look at every packet of the whole run."""
        packets = [each.packet for each in self.observer.log if each.packet.component_id == 1]
        ahead = [(after.seq - before.seq) % 256 for before, after in pairwise(packets)]
        lost = sum(each - 1 if each <= 256 - REORDERED else -1 for each in ahead)
        old, damaged = sum(not each.is_v2 for each in packets), self.observer.damaged
        words = f"{lost} missing, {damaged} damaged, {old} of MAVLink 1, of {len(packets)}"
        return Seen(max(lost, damaged) <= LOSS_LIMIT * len(packets) and not old, words)


async def check_all(
    observer: Observer, options: Options, only: Collection[str] = GROUPS
) -> AsyncIterator[tuple[Check, Seen]]:
    """Yield the checks of the groups with what they have seen. Raise Interference."""
    if not await observer.found(FIRST_HEARD):
        raise Interference(f"no heartbeat of a rover within {FIRST_HEARD:g} s")
    rover = Rover(observer, Driver(observer), options)
    for check in CHECKS:
        if check.group in only:
            yield check, await getattr(rover, check.look)(*check.arguments.split())
