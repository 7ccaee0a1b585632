"""The manoeuvres in which the real autopilots were recorded, and what is kept of a drive."""

import asyncio
import math
from bisect import bisect_left, bisect_right
from dataclasses import dataclass, field
from typing import NamedTuple

from pymavlink.dialects.v20 import development as mav

from rover_sim.observing.driver import Autopilot, Driver
from rover_sim.observing.observer import Answer, Heard
from rover_sim.observing.track import Place, Track

STANDING_TIME = 40.0  # s disarmed; half as long armed
#: s from a real rover's first message to its first HEARTBEAT, by which a driver detects it. The
#: simulated ones send a HEARTBEAT first
FIRST_HEARTBEAT = 1.0
RETRY = 3.0  # s between two attempts to arm
STICK = 1750  # µs, channel 3: half forward
STILL = 0.15  # m/s reported; a slower rover counts as standing while nothing is sent
ARMED = "armed for the first time"
STANDING_DISARMED, STANDING_ARMED = "standing disarmed", "standing armed"
READYING = "arming and taking control"
HOLD, SILENCE, DISARM = "HOLD at 1 m/s", "set-points end at 1 m/s", "disarm at 1 m/s"
DRIVEN, DISARMED_AGAIN = "home: driven", "home: disarmed again"
THEN_ZEROS = ", then zeros"
FREE, PUSHED, RELEASED = "stick free, ", "stick forward, ", "stick released, "
STICK_SPEEDS = {"0 m/s": 0.0, "0.5 m/s": 0.5}
FAST = {True: 50.0, False: 40.0}  # Hz, by whether it is a PX4; 40 is ArduPilot's maximum
SLOW = 5.0  # Hz
ASK_PLACES, ASK_RATES = 2.0, 10  # s between requests of home; requests of rates after so many
FAST_IDS = (mav.MAVLINK_MSG_ID_ATTITUDE, mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
SLOW_IDS = (mav.MAVLINK_MSG_ID_SYS_STATUS, mav.MAVLINK_MSG_ID_EXTENDED_SYS_STATE)
PLACES = (mav.MAVLINK_MSG_ID_HOME_POSITION, mav.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN)


class Step(NamedTuple):
    """A velocity that is streamed for some seconds, then zeros."""

    name: str
    speed: float  # m/s
    yaw_rate: float = 0.0  # deg/s, clockwise; a PX4 rover gets a velocity that turns at this rate
    aside: float = 0.0  # deg from the heading: the direction of the velocity, on PX4
    seconds: float = 5.0
    rest: float = 5.0  # s of zeros


SPEED_STEPS = (
    *(Step(f"{speed:g} m/s", speed) for speed in (0.5, 1.0, 2.0, -0.5)),
    *(Step(f"{speed:g} m/s", speed, seconds=8.0) for speed in (0.1, 0.05, 0.02)),
)
SPOT_TURNS = tuple(
    Step(f"{rate:+g} deg/s on the spot", 0.0, rate, seconds=4.0, rest=3.0) for rate in (30.0, -30.0)
)
SIDEWAYS = tuple(
    Step(f"0.1 m/s at {aside:+g} deg", 0.1, aside=aside, seconds=4.0, rest=3.0)
    for aside in (90.0, -90.0)
)
BEND = Step("0.5 m/s with 20 deg/s", 0.5, 20.0)
STEPS = {step.name: step for step in SPEED_STEPS}


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
    silent_since: float  # s, the last setpoint before SILENCE

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
    silent_since: float = 0.0

    async def run(self) -> Trace:
        """Drive all manoeuvres."""
        driver, observer = self.driver, self.driver.observer
        self._mark("start")
        await observer.found(60.0)
        asking = asyncio.ensure_future(self._keep_asking())
        await self._begin()
        await self._stand()
        turns = SIDEWAYS if driver.make.by_course else SPOT_TURNS
        for step in (*SPEED_STEPS, *turns, BEND):
            await self._step(step)
        await self._ends()
        if not driver.make.by_course:
            for name, speed in STICK_SPEEDS.items():
                await self._push_stick(name, speed)
        await self._move_home()
        self._mark("end")
        asking.cancel()
        heard: dict[str, list[Heard]] = {}
        for each in observer.log:
            heard.setdefault(each.name, []).append(each)
        return Trace(
            driver.make, heard, self.truth, observer.answers, self.marks, self.silent_since
        )

    def _mark(self, name: str) -> None:
        self.marks.append((self.driver.observer.now, name))

    async def _keep_asking(self) -> None:
        """Ask for places, and again for rates, which a restarted rover has lost."""
        driver, turn = self.driver, 0
        while True:
            if turn % ASK_RATES == 0:
                await driver.ask_rates(FAST[driver.make.by_course], *FAST_IDS)
                await driver.ask_rates(SLOW, *SLOW_IDS)
            for number in PLACES:
                await driver.observer.command(mav.MAV_CMD_REQUEST_MESSAGE, number)
            turn += 1
            await asyncio.sleep(ASK_PLACES)

    async def _begin(self) -> None:
        driver = self.driver
        await asyncio.sleep(FIRST_HEARTBEAT)
        in_control = driver.make.by_course  # PX4 needs a stream before OFFBOARD
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

    async def _stand(self) -> None:
        self._mark(STANDING_DISARMED)
        await asyncio.sleep(STANDING_TIME)
        await self._get_ready()
        self._mark(STANDING_ARMED)
        await self.driver.zeros(STANDING_TIME / 2)

    async def _get_ready(self) -> None:
        if not self.driver.is_ready:
            self._mark(READYING)
            await self.driver.get_ready(10)

    async def _step(self, step: Step) -> None:
        await self._get_ready()
        self._mark(step.name)
        rate, aside = math.radians(step.yaw_rate), math.radians(step.aside)
        await self.driver.stream(step.speed, step.seconds, yaw_rate=rate, aside=aside)
        self._mark(step.name + THEN_ZEROS)
        await self.driver.zeros(step.rest)

    async def _ends(self) -> None:
        for mark, at_most in ((HOLD, 15.0), (SILENCE, 25.0), (DISARM, 15.0)):
            await self._get_ready()
            self._mark("1 m/s for the next")
            await self.driver.stream(1.0, 5.0)
            self._mark(mark)
            if mark == HOLD:
                await self.driver.hold()
            elif mark == DISARM:
                await self.driver.arm(on=False)
            else:
                self.silent_since = self.driver.last_setpoint_at
            await self._until_it_stands(at_most)

    async def _until_it_stands(self, at_most: float) -> None:
        """Wait until the rover has reported standstill for 5 s."""
        stood = waited = 0.0
        while stood < 5.0 and waited < at_most:
            await asyncio.sleep(0.1)
            waited += 0.1
            stood = stood + 0.1 if self.driver.place.speed <= STILL else 0.0

    async def _push_stick(self, name: str, speed: float) -> None:
        push = self.driver.observer.push_stick
        await self._get_ready()
        self._mark(FREE + name)
        await self.driver.stream(speed, 4.0)
        self._mark(PUSHED + name)
        push(STICK)
        await self.driver.stream(speed, 3.0)
        self._mark(RELEASED + name)
        push(None)
        await self.driver.stream(speed, 4.0)
        self._mark("stick: zeros")
        await self.driver.zeros(4.0)

    async def _move_home(self) -> None:
        driver = self.driver
        await driver.arm(on=False)
        await asyncio.sleep(6.0)
        await self._get_ready()
        self._mark(DRIVEN)
        await driver.stream(1.0, 8.0)
        await driver.zeros(4.0)
        self._mark(DISARMED_AGAIN)
        await driver.arm(on=False)
        await asyncio.sleep(7.0)
        await self._get_ready()
        self._mark("home: armed again")
        await driver.zeros(5.0)
        await driver.arm(on=False)
        await asyncio.sleep(4.0)
