"""The manoeuvres in which the real autopilots were recorded, and what is kept of a drive.

manoeuvres.csv has them: a mark, what is done (a method of ``Drive`` or ``Driver``), with which
numbers (m/s, s, deg/s, deg), and the only make that does it. A row without a mark goes on with the
one before.
"""

import asyncio
import csv
from bisect import bisect_left
from dataclasses import dataclass, field
from math import radians
from operator import attrgetter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import development as mav

from rover_sim.observing.driver import Driver
from rover_sim.observing.observer import Heard, until
from rover_sim.observing.track import Place, Track

#: s from a real rover's first message to its first HEARTBEAT, by which a driver detects it. The
#: simulated ones send a HEARTBEAT first
FIRST_HEARTBEAT = 1.0
RETRY = 3.0  # s between two attempts to arm
STILL, STILL_FOR = 0.15, 5.0  # m/s reported, s; then a rover stands
FAST, SLOW = 20.0, 5.0  # Hz
ASK_PLACES, ASK_RATES = 2.0, 10  # s between requests of home; requests of rates after so many
FAST_IDS = (mav.MAVLINK_MSG_ID_ATTITUDE, mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
SLOW_IDS = (mav.MAVLINK_MSG_ID_SYS_STATUS, mav.MAVLINK_MSG_ID_EXTENDED_SYS_STATE)
PLACES = (mav.MAVLINK_MSG_ID_HOME_POSITION, mav.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN)

POSE = attrgetter("time", "north", "east", "yaw", "speed", "yaw_rate")

with Path(__file__).with_suffix(".csv").open(encoding="utf-8", newline="") as _file:
    ROWS = [tuple(row.values()) for row in csv.DictReader(_file)]
#: m/s that was asked, by mark
ASKED = {mark: float(numbers.split()[0]) for mark, do, numbers, _ in ROWS if do == "stream"}


class Moment:
    """One manoeuvre, as a client and the judge of the truth saw it; times in s.

    Of each true place: the time since the beginning, s; yaw, rad, beyond a full turn if it turned
    that far; speed, m/s, and as it was asked (a PX4 follows a velocity over ground); yaw rate,
    rad/s; metres driven from the first place.
    """

    def __init__(
        self, mark: str, begin: float, end: float, driver: Driver, places: list[Place]
    ) -> None:
        self.mark, self.begin, self.end = mark, begin, end
        self.log, self.answers = driver.observer.log, driver.observer.answers  # of the whole drive
        true = np.array([POSE(place) for place in places]).reshape(-1, 6).T
        self.time, self.yaw, self.speed, self.yaw_rate = (
            true[0] - begin,
            np.unwrap(true[3]),
            true[4],
            true[5],
        )
        course = np.cos(self.yaw - self.yaw[:1]) if driver.make.is_px4 else 1.0
        self.along = self.speed * course
        steps = np.hypot(np.diff(true[1]), np.diff(true[2]))
        self.way = np.concatenate(([0.0], np.cumsum(steps)))

    def heard(self, name: str, before: float = 0.0) -> list[Heard]:
        """Return the messages of that name, also those since ``before`` seconds before it."""
        first = bisect_left(self.log, self.begin - before, key=lambda row: row.at)
        last = bisect_left(self.log, self.end, key=lambda row: row.at)
        return [row for row in self.log[first:last] if row.name == name]

    def fields(self, name: str, *fields: str, before: float = 0.0) -> NDArray[np.float64]:
        """Return a row of values for each field of those messages."""
        rows = [[getattr(row.message, each) for each in fields] for row in self.heard(name, before)]
        return np.array(rows).T


@dataclass
class Drive:
    """Drives one rover through all of it."""

    driver: Driver
    truth: Track
    marks: list[tuple[float, str]] = field(default_factory=list)

    async def run(self) -> dict[str, Moment]:
        """Drive all manoeuvres; return the first of each mark."""
        driver, observer = self.driver, self.driver.observer
        await observer.found(60.0)
        asking = asyncio.ensure_future(self._keep_asking())
        for mark, do, numbers, only in ROWS:
            if only not in ("", driver.make.name):
                continue
            if do == "stream" and not driver.is_ready:
                self._mark("arming")
                await self.ready()
            if mark:
                self._mark(mark)
            await (getattr(self, do, None) or getattr(driver, do))(*map(float, numbers.split()))
        asking.cancel()
        moments: dict[str, Moment] = {}
        for number, (begin, mark) in enumerate(self.marks[:-1]):
            end = self.marks[number + 1][0]
            places = self.truth.between(begin, end)
            moments.setdefault(mark, Moment(mark, begin, end, driver, places))
        return moments

    def _mark(self, name: str) -> None:
        """Begin a moment now; the first one began with the first message."""
        observer = self.driver.observer
        self.marks.append((observer.now if self.marks else observer.log[0].at, name))

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
            await until(lambda: driver.is_armed, RETRY)
        self._mark("armed for the first time")
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
        """Arm it in the mode that follows setpoints."""
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
