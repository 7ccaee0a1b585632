"""The manoeuvres in which the real autopilots were recorded, and what is kept of a drive.

manoeuvres.csv has them: a mark, what is done (a method of ``Drive`` or ``Driver``), with which
numbers (m/s, s, deg/s, deg), and the only make that does it. A row without a mark goes on with the
one before.
"""

import asyncio
import csv
from bisect import bisect_left, bisect_right
from dataclasses import dataclass, field
from math import radians
from pathlib import Path
from typing import NamedTuple

from pymavlink.dialects.v20 import development as mav

from rover_sim.observing.driver import Autopilot, Driver
from rover_sim.observing.observer import Answer, Heard
from rover_sim.observing.track import Place, Track

#: s from a real rover's first message to its first HEARTBEAT, by which a driver detects it. The
#: simulated ones send a HEARTBEAT first
FIRST_HEARTBEAT = 1.0
RETRY = 3.0  # s between two attempts to arm
STILL, STILL_FOR = 0.15, 5.0  # m/s reported, s; then a rover stands
ARMED, READYING = "armed for the first time", "arming and taking control"
FAST, SLOW = 20.0, 5.0  # Hz
ASK_PLACES, ASK_RATES = 2.0, 10  # s between requests of home; requests of rates after so many
FAST_IDS = (mav.MAVLINK_MSG_ID_ATTITUDE, mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
SLOW_IDS = (mav.MAVLINK_MSG_ID_SYS_STATUS, mav.MAVLINK_MSG_ID_EXTENDED_SYS_STATE)
PLACES = (mav.MAVLINK_MSG_ID_HOME_POSITION, mav.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN)

with Path(__file__).with_suffix(".csv").open(encoding="utf-8", newline="") as _file:
    ROWS = [tuple(row.values()) for row in csv.DictReader(_file)]
#: m/s that was asked, by mark
ASKED = {mark: float(numbers.split()[0]) for mark, do, numbers, _ in ROWS if do == "stream"}


class Span(NamedTuple):
    """A time interval, s."""

    begin: float
    end: float


@dataclass(slots=True)
class Trace:
    """One drive through the manoeuvres, as a client and as the judge of the truth saw it."""

    make: Autopilot
    heard: dict[str, list[Heard]]
    truth: Track
    answers: list[Answer]
    marks: list[tuple[float, str]]
    set_points_ended: float  # s, before the manoeuvre in which there are none

    def span(self, mark: str) -> Span:
        """Return the interval from the first such mark to the next one; empty: not driven."""
        names = [name for _, name in self.marks]
        if mark not in names:
            return Span(0.0, 0.0)
        at = names.index(mark)
        return Span(self.marks[at][0], self.marks[at + 1][0])

    def messages(self, name: str, span: Span) -> list[Heard]:
        """Return the messages of that name within the span."""
        rows = self.heard.get(name, [])
        first = bisect_left(rows, span.begin, key=lambda row: row.at)
        return rows[first : bisect_right(rows, span.end, key=lambda row: row.at)]

    def poses(self, span: Span) -> list[Place]:
        """Return the true places within the span."""
        return self.truth.between(*span)


@dataclass
class Drive:
    """Drives one rover through all of it."""

    driver: Driver
    truth: Track
    marks: list[tuple[float, str]] = field(default_factory=list)

    async def run(self) -> Trace:
        """Drive all manoeuvres."""
        driver, observer, ended = self.driver, self.driver.observer, 0.0
        await observer.found(60.0)
        asking = asyncio.ensure_future(self._keep_asking())
        for mark, do, numbers, only in ROWS:
            if only not in ("", driver.make.name):
                continue
            if do == "stream":
                await self.ready()
            if mark:
                self._mark(mark)
            if mark.startswith("set-points end"):
                ended = driver.last_setpoint_at
            await (getattr(self, do, None) or getattr(driver, do))(*map(float, numbers.split()))
        asking.cancel()
        heard: dict[str, list[Heard]] = {}
        for each in observer.log:
            heard.setdefault(each.name, []).append(each)
        return Trace(driver.make, heard, self.truth, observer.answers, self.marks, ended)

    def _mark(self, name: str) -> None:
        self.marks.append((self.driver.observer.now, name))

    async def _keep_asking(self) -> None:
        """Ask for places, and again for rates, which a restarted rover has lost."""
        driver, turn = self.driver, 0
        while True:
            if turn % ASK_RATES == 0:
                await driver.ask_rates(FAST, *FAST_IDS)
                await driver.ask_rates(SLOW, *SLOW_IDS)
            for number in PLACES:
                await driver.observer.command(mav.MAV_CMD_REQUEST_MESSAGE, number)
            turn += 1
            await asyncio.sleep(ASK_PLACES)

    # what manoeuvres.csv asks for

    async def boot(self) -> None:
        """Try to arm until it arms, then disarm, in the mode that follows setpoints."""
        driver = self.driver
        await asyncio.sleep(FIRST_HEARTBEAT)
        in_control = driver.make.is_px4  # PX4 needs a stream before OFFBOARD
        while not driver.is_armed:
            in_control = in_control or (await driver.take_control()).is_accepted
            await driver.hold()
            await driver.arm()
            await driver.observer.until(lambda: driver.is_armed, RETRY)
        self._mark(ARMED)
        await asyncio.sleep(1.0)
        await driver.arm(on=False)
        while not in_control:
            await asyncio.sleep(RETRY)
            in_control = (await driver.take_control()).is_accepted
        await driver.hold()
        await asyncio.sleep(1.0)

    async def wait(self, seconds: float) -> None:
        """Let time pass without setpoints."""
        await asyncio.sleep(seconds)

    async def ready(self) -> None:
        """Arm it in the mode that follows setpoints, if it is not."""
        if not self.driver.is_ready:
            self._mark(READYING)
            await self.driver.get_ready(10)

    async def stream(self, speed: float, seconds: float, rate: float = 0, aside: float = 0) -> None:
        """Stream a velocity; a PX4 rover gets one that turns at the rate."""
        await self.driver.stream(speed, seconds, yaw_rate=radians(rate), aside=radians(aside))

    async def disarm(self) -> None:
        """Disarm it."""
        await self.driver.arm(on=False)

    async def stick(self, throttle: float) -> None:
        """Hold the throttle stick, µs; 0 releases it."""
        self.driver.observer.push_stick(int(throttle) or None)

    async def stands(self, at_most: float) -> None:
        """Wait until the rover has reported standstill for a while."""
        stood = waited = 0.0
        while stood < STILL_FOR and waited < at_most:
            await asyncio.sleep(0.1)
            waited += 0.1
            stood = stood + 0.1 if self.driver.place.speed <= STILL else 0.0
