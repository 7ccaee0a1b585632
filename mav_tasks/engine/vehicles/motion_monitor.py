"""A vehicle's own position, heading and standstill, from LOCAL_POSITION_NED and ATTITUDE.

Data is as old as the vehicle's own clock says, however long the network delayed it.
"""

from math import cos, hypot, inf, isfinite, sin

from mav_tasks.engine.vehicles.sender_clock import Heard, SenderClock
from mav_tasks.engine.vehicles.standstill import Standstill
from mav_tasks.mavlink.messages import Attitude, LocalPositionNed
from mav_tasks.settings import Watch
from mav_tasks.tasks.driving.guidance import Motion
from mav_tasks.tasks.task import Pose


class MotionMonitor:
    """The motion that one vehicle reports."""

    def __init__(self, watch: Watch) -> None:
        self._watch = watch
        self._position: LocalPositionNed | None = None
        self._position_at = 0.0
        self._attitude: Attitude | None = None
        self._attitude_at = 0.0
        self._moved_at: float | None = None
        self._latest: Motion | None = None  # computed from the last messages when needed
        #: when its messages were sent, by their time stamps
        self.clock = SenderClock()
        #: its recent positions, and its noise at rest
        self.standstill = Standstill()
        self._doubted_until = -inf

    def apply(self, watch: Watch) -> None:
        self._watch = watch

    def receive(
        self, message: Attitude | LocalPositionNed, *, now: float, not_after: float = inf
    ) -> Heard:
        """Process a message and return its classification; one that is not finite counts as old.

        A message that is read late counts as sent at ``not_after`` at the latest.
        """
        if not is_finite(message):
            return Heard.OLD
        heard = self.clock.hear(message, now=now)
        if heard is not Heard.NEWS:
            return heard
        sent_at = min(self.clock.sent_at(message.time_boot_ms, now=now), not_after)
        self._latest = None
        if isinstance(message, LocalPositionNed):
            if not self._is_frozen(message):
                self._position_at = sent_at
            self._position = message
        else:
            self._attitude, self._attitude_at = message, sent_at
        if self._moved_at is None or not self._is_slow():
            self._moved_at = now
        motion = self.latest()
        if motion is not None and isinstance(message, LocalPositionNed):
            self.standstill.receive(motion, now=sent_at)
        return heard

    def latest(self) -> Motion | None:
        """Return the last measured motion, or None before both messages have come."""
        if self._latest is None:
            self._latest = self._motion()
        return self._latest

    def _motion(self) -> Motion | None:
        position, attitude = self._position, self._attitude
        if position is None or attitude is None:
            return None
        north, east = cos(attitude.yaw), sin(attitude.yaw)
        return Motion(
            pose=Pose(position.x, position.y, attitude.yaw),
            forward=position.vx * north + position.vy * east,
            sideways=position.vy * north - position.vx * east,
            yaw_rate=attitude.yawspeed,
            at=min(self._position_at, self._attitude_at),
        )

    def is_still(self, *, now: float) -> bool:
        """Return whether fresh data shows that the vehicle has stood for a while.

        Silence since it moved is no standstill, however long data counts as fresh.
        """
        motion, watch = self.latest(), self._watch
        if motion is None or now - motion.at > watch.motion_fresh or now < self._doubted_until:
            return False
        if abs(motion.yaw_rate) >= watch.still_turn_rate:  # at rest, 1.4 deg/s at most was measured
            return False
        says_so = (
            self._is_slow()
            and self._moved_at is not None
            and now - self._moved_at >= watch.still_time
        )
        if says_so and self.standstill.confirms(watch, now=now):
            return True
        return self.standstill.has_stood(watch, now=now)

    def doubt(self, *, until: float) -> None:
        """Do not believe a standstill before ``until``."""
        self._doubted_until = until

    def forget(self) -> None:
        """Forget everything, as after a restart of the vehicle."""
        self._position = self._attitude = self._latest = None
        self._moved_at = None
        self.standstill.forget()
        self.clock = SenderClock()

    def _is_frozen(self, message: LocalPositionNed) -> bool:
        """Return whether it reports a speed but an unchanged position: its estimator is frozen.

        Such a position is as old as the first one with the same coordinates.
        """
        last = self._position
        return (
            last is not None
            and (message.x, message.y) == (last.x, last.y)
            and hypot(message.vx, message.vy) >= self._watch.still_speed
        )

    def _is_slow(self) -> bool:
        position, attitude = self._position, self._attitude
        watch = self._watch
        return (
            position is not None
            and attitude is not None
            and hypot(position.vx, position.vy) < watch.still_speed
            and abs(attitude.yawspeed) < watch.still_turn_rate
        )


def is_finite(message: Attitude | LocalPositionNed) -> bool:
    if isinstance(message, LocalPositionNed):
        return all(map(isfinite, (message.x, message.y, message.vx, message.vy)))
    return isfinite(message.yaw) and isfinite(message.yawspeed)
