"""What the server and its clients rely on, and ``mav-tasks probe`` does not tell.

contract.csv has the checks: how each looks (a method of ``Rover``), with what, and what must be
seen: a number within ``least..most``, or words by a regular expression. Nothing moves or stays
changed: the mode of a disarmed rover is changed and set back.
"""

import asyncio
import csv
import math
import re
from collections.abc import AsyncIterator, Collection
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from pymavlink.dialects.v20 import development as mav

from rover_sim.observing.driver import CUSTOM_MODE, Driver, Interference
from rover_sim.observing.observer import AUTOPILOT, PATIENCE, Answer, Observer

FIRST_HEARD = 10.0  # s to wait for a rover
LISTENED = 3.0  # s
AFTERMATH = 0.2  # s in which a duplicate answer would come
SHOWN_WITHIN = 2.5  # s until a heartbeat shows a mode or arming
ARMED_WITHIN = 15.0  # s in which a rover may still refuse after its start
REORDERED = 8  # packets that another one overtakes; PX4 1.17 sometimes swaps two
BY_NAME = -1  # param_index in a request
REQUEST, VERSION = mav.MAV_CMD_REQUEST_MESSAGE, mav.MAVLINK_MSG_ID_AUTOPILOT_VERSION

NONSENSE = 99 << 16 | 99  # a mode that does not exist; of PX4 a main mode
#: parameters without which QGroundControl asks for setup when it connects, by make
NEEDED = {
    "ardupilot": "RCMAP_ROLL RCMAP_PITCH RCMAP_THROTTLE RCMAP_YAW FRAME_CLASS COMPASS_DEV_ID "
    "COMPASS_DEV_ID2 COMPASS_DEV_ID3 INS_ACCOFFS_X INS_ACCOFFS_Y INS_ACCOFFS_Z RC1_MIN RC1_MAX "
    "RC1_TRIM RC2_MIN RC2_MAX RC2_TRIM RC3_MIN RC3_MAX RC3_TRIM RC4_MIN RC4_MAX RC4_TRIM",
    "px4": "SYS_AUTOSTART COM_RC_IN_MODE CAL_GYRO0_ID CAL_ACC0_ID SYS_HAS_MAG _HASH_CHECK",
}
Value = float | str | None  # None: it could not look


class Check(NamedTuple):
    """One check, as contract.csv has it."""

    group: str
    name: str
    look: str
    arguments: str
    expected: str
    note: str

    def is_right(self, value: Value) -> bool | None:
        """Return whether a value is as expected; None if there is none."""
        if value is None:
            return None
        if isinstance(value, str):
            return re.fullmatch(self.expected, value) is not None
        least, most = map(float, self.expected.split(".."))
        return least <= value <= most


with Path(__file__).with_suffix(".csv").open(encoding="utf-8", newline="") as _file:
    CHECKS = tuple(Check(*row.values()) for row in csv.DictReader(_file))
GROUPS = tuple(dict.fromkeys(check.group for check in CHECKS))


@dataclass
class Rover:
    """The rover that is checked; each public coroutine is a look."""

    observer: Observer
    driver: Driver
    may_arm: bool

    @property
    def _target(self) -> tuple[int, int]:
        return self.observer.system, AUTOPILOT

    async def field(self, name: str, field: str) -> float:
        """Return a field of the last message of this name, which is requested if none came."""
        if self.observer.message(name) is None:
            await self.observer.command(REQUEST, getattr(mav, f"MAVLINK_MSG_ID_{name}"))
            await self.observer.until(lambda: self.observer.message(name), AFTERMATH)
        message = self.observer.message(name)
        return math.nan if message is None else float(getattr(message, field))

    async def headings_apart(self) -> Value:
        """Return the degrees between the headings of two messages."""
        yaw = await self.field("ATTITUDE", "yaw")
        heading = await self.field("GLOBAL_POSITION_INT", "hdg")
        return abs(math.remainder(math.degrees(yaw) - heading / 100, 360.0))

    async def rate(self, hertz: str) -> Value:
        """Ask for ATTITUDE at a rate; return that with which it comes."""
        mark = len(self.observer.log)
        await self.driver.ask_rates(float(hertz), mav.MAVLINK_MSG_ID_ATTITUDE)
        await asyncio.sleep(LISTENED)
        times = [each.at for each in self.observer.since(mark, "ATTITUDE")]
        await self.driver.ask_rates(0.0, mav.MAVLINK_MSG_ID_ATTITUDE)
        return (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else 0.0

    async def pace(self) -> Value:
        """Return the pace of its clock."""
        rows = self.observer.since(0, "ATTITUDE")
        passed = [b.message.time_boot_ms - a.message.time_boot_ms for a, b in pairwise(rows)]
        if min(passed, default=-1) < 0:
            return "it goes back, or is not known"
        return float(sum(passed) / (rows[-1].at - rows[0].at))

    # answers

    async def command(self, *numbers: str) -> Value:
        """Ask a command."""
        command, *params = map(float, numbers)
        return _kind(await self.observer.command(int(command), *params))

    async def request(self, message_id: str) -> Value:
        """Ask for a message."""
        mark = len(self.observer.log)
        kind = _kind(await self.observer.command(REQUEST, float(message_id)))
        await asyncio.sleep(AFTERMATH)
        ids = [each.packet.message_id for each in self.observer.log[mark:]]
        return f"{kind} and sent" if int(message_id) in ids else kind

    async def by_command_int(self) -> Value:
        """Ask by COMMAND_INT."""
        fields = (0, REQUEST, 0, 0, float(VERSION), 0.0, 0.0, 0.0, 0, 0, 0.0)
        out = self.observer.out
        return str(await self.observer.ask(out.command_int_encode(*self._target, *fields)))

    async def acknowledged(self) -> Value:
        """Look at the acknowledgements of one command."""
        out, mark = self.observer.out, len(self.observer.log)
        await self.observer.command(REQUEST, VERSION)
        await asyncio.sleep(AFTERMATH)
        acks = (
            (each.packet.component_id, each.message.target_system, each.message.target_component)
            for each in self.observer.since(mark, "COMMAND_ACK")
        )
        right = (AUTOPILOT, out.srcSystem, out.srcComponent)
        return ", ".join("right" if ack == right else f"from, to: {ack}" for ack in acks)

    async def of_another(self) -> Value:
        """Ask something of another system."""
        other = 1 + self.observer.system % 250
        return str(await self.observer.command(REQUEST, VERSION, system=other))

    async def missing(self) -> Value:
        """Read the parameters that QGroundControl needs."""
        out, wait = self.observer.out, self.observer.wait
        absent = []
        for name in NEEDED.get(self.driver.make.name, "").split():
            asking = out.param_request_read_encode(*self._target, name.encode(), BY_NAME)
            self.observer.send(asking)
            if not await wait("PARAM_VALUE", PATIENCE, lambda m, name=name: m.param_id == name):
                absent.append(name)
        return ", ".join(absent)

    # modes and arming

    async def enter(self, name: str, message: str = "") -> Value:
        """Enter a mode of the driver's make, by a command or SET_MODE; restore the present one."""
        driver, observer = self.driver, self.observer
        if driver.is_armed:
            return None  # it could move
        before, mode = driver.mode, getattr(driver.make, name, NONSENSE)
        answer = ""
        try:
            if driver.make.is_px4 and mode == driver.make.control:
                await driver.zeros(1.0)
            if message:
                observer.send(observer.out.set_mode_encode(observer.system, CUSTOM_MODE, mode))
            else:
                answer = str(await driver.set_mode(mode))
            shown = await observer.until(lambda: driver.mode == mode, SHOWN_WITHIN)
            return f"{answer}, {'' if shown else 'not '}shown"
        finally:
            await driver.set_mode(before)
            await observer.until(lambda: driver.mode == before, SHOWN_WITHIN)

    async def arms(self) -> Value:
        """Arm in HOLD, and disarm."""
        driver, observer = self.driver, self.observer
        if not self.may_arm or driver.is_armed:
            return None
        await driver.hold()
        try:
            end, answer = observer.now + ARMED_WITHIN, await driver.arm()
            while not answer.is_accepted and observer.now < end:
                await asyncio.sleep(1.0)
                answer = await driver.arm()
            shown = await observer.until(lambda: driver.is_armed, SHOWN_WITHIN)
        finally:
            rested = await driver.rest()
        return f"{answer}, {'' if shown else 'not '}shown, {'' if rested else 'not '}at rest again"

    async def bad_packets(self) -> Value:
        """Look at every packet of the whole run."""
        packets = [each.packet for each in self.observer.log if each.packet.component_id == 1]
        ahead = [(after.seq - before.seq) % 256 for before, after in pairwise(packets)]
        lost = sum(each - 1 if each <= 256 - REORDERED else -1 for each in ahead)
        old = sum(not each.is_v2 for each in packets)
        return max(lost, self.observer.damaged, old) / len(packets)


def _kind(answer: Answer) -> str:
    return "refused" if answer.is_refused else str(answer).partition(" after ")[0]


async def check_all(
    observer: Observer, *, may_arm: bool = False, only: Collection[str] = GROUPS
) -> AsyncIterator[tuple[Check, Value]]:
    """Yield the checks of the groups with what they have seen. Raise Interference."""
    if not await observer.found(FIRST_HEARD):
        raise Interference(f"no heartbeat of a rover within {FIRST_HEARD:g} s")
    rover = Rover(observer, Driver(observer), may_arm)
    for check in CHECKS:
        if check.group in only:
            yield check, await getattr(rover, check.look)(*check.arguments.split())
