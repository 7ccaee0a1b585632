"""Drives the rover without the server, to measure which way of stopping is shorter."""

import asyncio
from collections.abc import Callable
from enum import Enum
from math import cos, sin
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mav

from mav_tasks.links.base import Link
from rover_sim.field_trial.endpoint import Endpoint
from rover_sim.field_trial.track import Place, Track

PERIOD = 0.05  # s between setpoints, 20 Hz
RATE_US = 40_000  # of position and attitude
OFFBOARD, PX4_HOLD = (6, 0), (4, 3)  # main and sub mode
GUIDED, ARDUPILOT_HOLD = (15, 0), (4, 0)
VELOCITY, VELOCITY_AND_YAW_RATE = 0x0DC7, 0x05C7  # type_mask
READY_WITHIN = 60.0  # s; ArduPilot can be armed 41 s after power-on
ASK_AGAIN = 1.0  # s
LOOK = 0.01  # s between two checks for an answer
BRAKES = 6.0  # s to stop
PRESS_ON = 1e-3  # m/s, so that a standing PX4 keeps its course


class Way(Enum):
    """A way to stop the rover."""

    ZEROS = "zeros"
    HOLD = "HOLD"


class Pilot:
    """Drives straight ahead, and measures the stopping distance."""

    def __init__(self, link: Link, truth: Track | None) -> None:
        self._told = Track()
        self._endpoint = Endpoint(link, self._take)
        self._loop = asyncio.get_running_loop()
        self.track = self._told if truth is None else truth
        self._acks: dict[int, int] = {}

    async def close(self) -> None:
        """Stop and disarm the rover, and close the link."""
        for _ in range(20):
            self._setpoint(0.0)
            await asyncio.sleep(PERIOD)
        await self._mode(Way.HOLD)
        await self._ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)
        await self._endpoint.close()

    async def ready(self) -> bool:
        """Arm the rover in the mode that follows setpoints; return success."""
        end = self._loop.time() + READY_WITHIN
        while self._loop.time() < end:
            if "HEARTBEAT" in self._endpoint.last:
                for number in (mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED, mav.MAVLINK_MSG_ID_ATTITUDE):
                    self._endpoint.command(mav.MAV_CMD_SET_MESSAGE_INTERVAL, number, RATE_US)
                await self._stand(0.5)
                if await self._mode(None) and await self._ask(
                    mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0
                ):
                    return True
            await self._stand(ASK_AGAIN)
        return False

    async def stopping(self, way: Way, *, speed: float, seconds: float) -> float | None:
        """Return the stopping distance from ``speed``, m; None if it is not reached."""
        if not await self.ready():
            return None
        await self._stream(speed, seconds)
        if self.track.speed() < speed * 0.8:
            return None
        begun = self.track.last
        if way is Way.HOLD:
            await self._mode(Way.HOLD)
            await asyncio.sleep(BRAKES)
        else:
            await self._stand(BRAKES)
            await self._mode(Way.HOLD)
            await asyncio.sleep(0.5)
        return self.track.last.apart(begun)

    async def _stand(self, seconds: float) -> None:
        await self._stream(PRESS_ON if self._is_px4 else 0.0, seconds)

    async def _stream(self, speed: float, seconds: float) -> None:
        end = self._loop.time() + seconds
        while self._loop.time() < end:
            self._setpoint(speed)
            await asyncio.sleep(PERIOD)

    def _setpoint(self, speed: float) -> None:
        attitude = self._endpoint.last.get("ATTITUDE")
        course = 0.0 if attitude is None else attitude.yaw
        if self._is_px4:
            frame, mask = mav.MAV_FRAME_LOCAL_NED, VELOCITY
            vx, vy = speed * cos(course), speed * sin(course)
        else:
            frame, mask, vx, vy = mav.MAV_FRAME_BODY_NED, VELOCITY_AND_YAW_RATE, speed, 0.0
        self._endpoint.out.set_position_target_local_ned_send(
            0, self._endpoint.system, 1, frame, mask, *(0.0,) * 3, vx, vy, *(0.0,) * 6
        )

    @property
    def _is_px4(self) -> bool:
        heartbeat = self._endpoint.last.get("HEARTBEAT")
        return heartbeat is not None and heartbeat.autopilot == mav.MAV_AUTOPILOT_PX4

    async def _mode(self, way: Way | None) -> bool:
        hold = way is Way.HOLD
        modes = (
            (PX4_HOLD if hold else OFFBOARD)
            if self._is_px4
            else (ARDUPILOT_HOLD if hold else GUIDED)
        )
        return await self._ask(mav.MAV_CMD_DO_SET_MODE, 1.0, *modes)

    async def _ask(self, number: int, *parameters: float) -> bool:
        self._acks.pop(number, None)
        self._endpoint.command(number, *parameters)
        for _ in range(round(ASK_AGAIN / LOOK)):
            if number in self._acks:
                break
            await asyncio.sleep(LOOK)
        return number in self._acks and self._acks[number] == int(mav.MAV_RESULT_ACCEPTED)

    def _take(self, message: Any) -> None:
        name = message.get_type()
        if name == "COMMAND_ACK":
            self._acks[message.command] = message.result
        elif name == "LOCAL_POSITION_NED" and "ATTITUDE" in self._endpoint.last:
            yaw = self._endpoint.last["ATTITUDE"].yaw
            self._told.add(Place(self._loop.time(), message.x, message.y, yaw))


def better(distances: dict[Way, list[float]], middle: Callable[[list[float]], float]) -> float:
    """Return the average (``middle``) distance of the better way, m."""
    return min(middle(values) for values in distances.values() if values)
