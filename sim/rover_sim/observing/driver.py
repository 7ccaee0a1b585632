"""Drives a rover by setpoints, without a task server, and never lets it run away.

A setpoint other than zero is sent only while the rover's heartbeat and position are fresh, it is
armed, it is in the mode that follows setpoints, and it is near the place where it began.
"""

import asyncio
from dataclasses import dataclass, replace
from math import cos, hypot, inf, isfinite, sin

from pymavlink.dialects.v20 import development as mav

from rover_sim.observing.observer import AUTOPILOT, Answer, Heard, Observer, until
from rover_sim.observing.track import Place, Track

PERIOD = 0.05  # s between setpoints, 20 Hz
VELOCITY, VELOCITY_AND_RATE = 0x0DC7, 0x05C7  # type_mask
CUSTOM_MODE, ARMED = 1, 128  # MAV_MODE_FLAG
FRESH_BEAT, FRESH_PLACE = 2.5, 1.0  # s
TRIES = 5  # of bringing the rover to rest
PRESS_ON = 1e-3  # m/s: a PX4 takes plain zeros for a course to the north


class Interference(Exception):
    """The rover must not be driven in its state; the message says why."""


@dataclass(frozen=True, slots=True)
class Autopilot:
    """What differs between the makes when they are driven by setpoints."""

    name: str
    hold: int  # HEARTBEAT.custom_mode
    control: int  # the mode that follows setpoints: GUIDED, OFFBOARD
    #: speaks as PX4 does: DO_SET_MODE has main and sub mode, setpoints come before the mode, and it
    #: follows a velocity over ground; else speed ahead and a yaw rate
    is_px4: bool


ARDUPILOT = Autopilot("ardupilot", 4, 15, is_px4=False)
PX4 = Autopilot("px4", 4 << 16 | 3 << 24, 6 << 16, is_px4=True)
GENERIC = replace(PX4, name="generic")
AUTOPILOTS = {mav.MAV_AUTOPILOT_ARDUPILOTMEGA: ARDUPILOT, mav.MAV_AUTOPILOT_PX4: PX4}


class Driver:
    """Arms, drives and stops the rover that an observer hears; its reported places are ``told``."""

    def __init__(
        self, observer: Observer, *, farthest: float = inf, keeps_course: bool = False
    ) -> None:
        """``farthest``: m from the first driven place. ``keeps_course``: also where zeros turn."""
        self.observer = observer
        self.told = Track()
        self._farthest = farthest
        self._keeps_course = keeps_course
        self._start: Place | None = None
        observer.listeners.append(self._note_place)

    # what it shows

    @property
    def make(self) -> Autopilot:
        """The conventions of the rover's make; it must have been heard."""
        return AUTOPILOTS.get(self.observer.message("HEARTBEAT").autopilot, GENERIC)

    @property
    def is_armed(self) -> bool:
        """Whether its last heartbeat says armed."""
        return bool(self.observer.message("HEARTBEAT").base_mode & ARMED)

    @property
    def mode(self) -> int:
        """The custom_mode of its last heartbeat."""
        return int(self.observer.message("HEARTBEAT").custom_mode)

    @property
    def is_ready(self) -> bool:
        """Whether it is armed and follows setpoints."""
        return self.is_armed and self.mode == self.make.control

    @property
    def place(self) -> Place:
        """Where it says that it is. Raise Interference if it does not."""
        if not len(self.told):
            raise Interference("no LOCAL_POSITION_NED, or no ATTITUDE")
        return self.told.last

    # what it is asked

    async def set_mode(self, mode: int) -> Answer:
        """Ask for a mode."""
        parts = (mode >> 16 & 0xFF, mode >> 24) if self.make.is_px4 else (mode,)
        return await self.observer.command(mav.MAV_CMD_DO_SET_MODE, CUSTOM_MODE, *parts)

    async def hold(self) -> Answer:
        """Ask for HOLD."""
        return await self.set_mode(self.make.hold)

    async def take_control(self) -> Answer:
        """Ask for the mode that follows setpoints."""
        return await self.set_mode(self.make.control)

    async def arm(self, *, on: bool = True) -> Answer:
        """Ask for arming, or for disarming."""
        return await self.observer.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, float(on))

    async def ask_rates(self, hertz: float, *messages: int) -> None:
        """Ask for messages at a rate; 0: as by default."""
        interval = 1e6 / hertz if hertz else 0.0
        for number in messages:
            await self.observer.command(mav.MAV_CMD_SET_MESSAGE_INTERVAL, number, interval)

    async def get_ready(self, tries: int) -> bool:
        """Arm it in the mode that follows setpoints, while it stands; return success."""
        for _ in range(tries):
            if self.is_ready:
                return True
            if not self.is_armed:
                if self.make.is_px4:
                    await self.hold()
                else:
                    # zeros replace an old setpoint, which an ArduPilot would drive when it is armed
                    await self.take_control()
                    await self.zeros(0.2)
                await self.arm()
            await self.zeros(1.2)
            await self.take_control()
            await self.zeros(1.2)
        return self.is_ready

    async def rest(self) -> bool:
        """Send zeros, HOLD and disarming until it shows both; return success."""
        for _ in range(TRIES):
            await self.zeros(3 * PERIOD)
            await self.hold()
            await self.arm(on=False)
            if await until(lambda: self.mode == self.make.hold and not self.is_armed, 1.5):
                return True
        return False

    # setpoints

    async def zeros(self, seconds: float) -> None:
        """Stream zero velocity."""
        await self.stream(PRESS_ON if self._keeps_course and self.make.is_px4 else 0.0, seconds)

    async def stream(
        self, speed: float, seconds: float, *, yaw_rate: float = 0.0, aside: float = 0.0
    ) -> None:
        """Stream a velocity: m/s ahead, rad/s clockwise, ``aside`` rad from the heading.

        Raise Interference.
        """
        begin, course = self.observer.now, self.place.yaw + aside if len(self.told) else aside
        for step in range(max(1, round(seconds / PERIOD))):
            if abs(speed) > PRESS_ON or yaw_rate:
                self._guard()
            if self.make.is_px4:
                turned = course + yaw_rate * step * PERIOD
                velocity = speed * cos(turned), speed * sin(turned)
                self._send(mav.MAV_FRAME_LOCAL_NED, VELOCITY, *velocity, 0.0)
            else:
                self._send(mav.MAV_FRAME_BODY_NED, VELOCITY_AND_RATE, speed, 0.0, yaw_rate)
            await asyncio.sleep(max(0.0, begin + (step + 1) * PERIOD - self.observer.now))

    def _send(self, frame: int, mask: int, vx: float, vy: float, yaw_rate: float) -> None:
        if not isfinite(vx + vy + yaw_rate):
            raise Interference("its heading is not a number")
        self.observer.out.set_position_target_local_ned_send(
            *(0, self.observer.system, AUTOPILOT, frame, mask),
            *(0.0, 0.0, 0.0, vx, vy, 0.0, 0.0, 0.0, 0.0, 0.0, yaw_rate),
        )

    def _guard(self) -> None:
        self._start = self._start or self.place
        for is_wrong, words in (
            (self.observer.silence("HEARTBEAT") > FRESH_BEAT, "no heartbeat"),
            (self.observer.silence("LOCAL_POSITION_NED") > FRESH_PLACE, "no LOCAL_POSITION_NED"),
            (not self.is_armed, "it is not armed any more"),
            (self.mode != self.make.control, f"it left the mode of setpoints for {self.mode:#x}"),
            (self.place.apart(self._start) > self._farthest, f"it is {self._farthest:g} m away"),
        ):
            if is_wrong:
                raise Interference(words)

    def _note_place(self, heard: Heard) -> None:
        attitude = self.observer.message("ATTITUDE")
        if heard.name == "LOCAL_POSITION_NED" and attitude is not None:
            m = heard.message
            speed = hypot(m.vx, m.vy)
            self.told.add(Place(heard.at, m.x, m.y, attitude.yaw, speed, attitude.yawspeed))
