"""A vehicle's own position, heading and standstill, from LOCAL_POSITION_NED and ATTITUDE.

Data is as old as the vehicle's own clock says, however long the network delayed it.

The speed that a standing rover reports is an offset that drifts over seconds: 0.03 m/s on an
ArduPilot with perfect sensors, 0.07 with noisy ones, and 0.2 to 0.6 for minutes on a PX4 that has
pushed against something (measured on both). Averaging does not help, and one threshold on the speed
is too high for one rover and too low for another. But a standing rover does not get anywhere. So it
stands

- at once, if for ``still_time`` both the reported speed and the displacement were small; or
- after a second in which it got no further than such a rover does at rest.

Its displacement and reported speed at rest are learnt while it is known to be told to stand, and
gets nowhere in the long run.
"""

from collections import deque
from math import cos, hypot, inf, isfinite, sin
from typing import NamedTuple

from mav_tasks.config.settings import Watch
from mav_tasks.engine.vehicles.sender_clock import Heard, SenderClock
from mav_tasks.kinds import Pose
from mav_tasks.kinds.guidance import Motion
from mav_tasks.kinds.path import wrap
from mav_tasks.mavlink.messages import Attitude, LocalPositionNed

WINDOW = 1.0  # s over which the displacement alone decides
KEPT = 6.0  # s of samples, for the longest window and for learning
SPACING = 0.035  # s between kept samples; positions come at 20 to 50 Hz
COVERED = 0.15  # s by which the first sample may be younger than the start of its window
#: m in a second: more than the 0.015 measured at rest with good sensors, less than at 0.05 m/s
LEAST_WAY = 0.03
LEAST_SPEED = 0.09  # m/s reported at rest before anything was learnt; 0.07 was measured
MOST_WAY = 0.25  # m in a second that count as noise at most; the most that was measured is 0.21
MOST_SPEED = 0.7  # m/s, the same for the reported speed; the most that was measured is 0.67
MARGIN = 1.5  # times what was learnt
REST = 5.0  # s of being told to stand before learning starts; the longest stop takes 4
DRIFT = 0.1  # m/s over that time; nothing is learnt above it, because the rover rolls
FORGETS = 60.0  # s in which a learnt value fades to a third, if smaller ones are seen


class Sample(NamedTuple):
    """One measurement: s, m north and east, rad, m/s."""

    at: float
    north: float
    east: float
    yaw: float
    speed: float


class MotionMonitor:
    """The motion that one vehicle reports, its last seconds, and its noise at rest."""

    def __init__(self, watch: Watch) -> None:
        self.watch = watch
        self._way = 0.0  # m in a second, learnt at rest
        self._speed = 0.0  # m/s reported, learnt at rest
        self._learnt_at = 0.0
        self._doubted_until = -inf
        self.forget()

    def __repr__(self) -> str:
        return f"MotionMonitor(at rest {self._way:.3f} m in a second, {self._speed:.3f} m/s)"

    def forget(self) -> None:
        """Forget everything but the noise, as after a restart of the vehicle."""
        self._position: LocalPositionNed | None = None
        self._position_at = 0.0
        self._attitude: Attitude | None = None
        self._attitude_at = 0.0
        self._is_slow = False  # as it reports
        self._moved_at = 0.0  # when it last reported a speed
        self._latest: Motion | None = None
        self._samples: deque[Sample] = deque()
        self._rests_since = inf  # told to stand without a break since then
        #: when its messages were sent, by their time stamps
        self.clock = SenderClock()

    def receive(
        self, message: Attitude | LocalPositionNed, *, now: float, not_after: float = inf
    ) -> Heard:
        """Process a message and return its classification; one that is not finite counts as old.

        A message that is read late counts as sent at ``not_after`` at the latest.
        """
        if not _is_finite(message):
            return Heard.OLD
        heard = self.clock.hear(message, now=now)
        if heard is not Heard.NEWS:
            return heard
        sent_at = min(self.clock.news_at, not_after)
        if isinstance(message, LocalPositionNed):
            if not self._is_frozen(message):
                self._position_at = sent_at
            self._position = message
        else:
            self._attitude, self._attitude_at = message, sent_at
        position, attitude, watch = self._position, self._attitude, self.watch
        if position is None or attitude is None:
            self._moved_at = now
            return heard
        self._is_slow = (
            hypot(position.vx, position.vy) < watch.still_speed
            and abs(attitude.yawspeed) < watch.still_turn_rate
        )
        if not self._is_slow:
            self._moved_at = now
        north, east = cos(attitude.yaw), sin(attitude.yaw)
        self._latest = Motion(
            pose=Pose(position.x, position.y, attitude.yaw),
            forward=position.vx * north + position.vy * east,
            sideways=position.vy * north - position.vx * east,
            yaw_rate=attitude.yawspeed,
            at=min(self._position_at, self._attitude_at),
        )
        if message is position:
            self._keep(self._latest, now=sent_at)
        return heard

    def latest(self) -> Motion | None:
        """Return the last measured motion, or None before both messages have come."""
        return self._latest

    def is_fresh(self, *, now: float) -> bool:
        """Return whether there is fresh data on how the vehicle moves."""
        return self._latest is not None and now - self._latest.at <= self.watch.motion_fresh

    def is_still(self, *, now: float) -> bool:
        """Return whether fresh data shows that the vehicle has stood for a while.

        Silence since it moved is no standstill, however long data counts as fresh.
        """
        motion, watch, turn_rate = self._latest, self.watch, self.watch.still_turn_rate
        if motion is None or not self.is_fresh(now=now) or now < self._doubted_until:
            return False
        if abs(motion.yaw_rate) >= turn_rate:  # at rest, 1.4 deg/s at most was measured
            return False
        way, time = min(MOST_WAY, max(LEAST_WAY, MARGIN * self._way)), watch.still_time
        if self._is_slow and now - self._moved_at >= time:  # does the displacement agree?
            most = 1.2 * max(watch.still_speed, way) * time
            if self._is_within(time, way=most, turn=2 * turn_rate * time, now=now):
                return True
        time = max(WINDOW, time)  # it got nowhere, although it may report a speed
        if not self._samples or self._samples[-1].speed > min(
            MOST_SPEED, max(LEAST_SPEED, MARGIN * self._speed)
        ):
            return False
        return self._is_within(time, way=way * time, turn=turn_rate * time, now=now)

    def doubt(self, *, until: float) -> None:
        """Do not believe a standstill before ``until``."""
        self._doubted_until = until

    def told_to_stand(self, *, now: float) -> None:
        """Note that everything that may move the vehicle tells it to stand, or it is disarmed."""
        self._rests_since = min(self._rests_since, now)

    def may_move(self) -> None:
        """Note that somebody may have told the vehicle to move: learning pauses."""
        self._rests_since = inf

    def displacement(self, window: float, *, now: float) -> tuple[float, float] | None:
        """Return m/s over a window up to now, and along the heading; None: it is not covered."""
        first = self._first_within(window, now=now)
        if first is None:
            return None
        last = self._samples[-1]
        north, east, took = last.north - first.north, last.east - first.east, last.at - first.at
        if took <= 0:
            return None
        along = north * cos(last.yaw) + east * sin(last.yaw)
        return hypot(north, east) / took, along / took

    def _is_frozen(self, message: LocalPositionNed) -> bool:
        """Return whether it reports a speed but an unchanged position: its estimator is frozen.

        Such a position is as old as the first one with the same coordinates.
        """
        last = self._position
        return (
            last is not None
            and (message.x, message.y) == (last.x, last.y)
            and hypot(message.vx, message.vy) >= self.watch.still_speed
        )

    def _keep(self, motion: Motion, *, now: float) -> None:
        """Keep where the vehicle is now, and learn its noise at rest."""
        samples, pose = self._samples, motion.pose
        if samples and now - samples[-1].at < SPACING:
            return
        samples.append(Sample(now, pose.north, pose.east, pose.yaw, motion.speed))
        while samples[0].at < now - KEPT:
            samples.popleft()
        if now - self._rests_since <= REST:
            return
        drift, way = self.displacement(REST, now=now), self.displacement(WINDOW, now=now)
        if drift is None or way is None or drift[0] > DRIFT:
            return
        kept = max(0.0, 1.0 - (now - self._learnt_at) / FORGETS)
        self._learnt_at = now
        self._way = max(min(way[0], MOST_WAY), self._way * kept)
        self._speed = max(min(motion.speed, MOST_SPEED), self._speed * kept)

    def _first_within(self, window: float, *, now: float) -> Sample | None:
        """Return the oldest sample of a window; None if the window is older than all samples."""
        since = now - window
        first = None
        for sample in reversed(self._samples):  # most windows are much shorter than KEPT
            if sample.at < since - 1e-9:
                return first
            first = sample
        return first if first is not None and first.at <= since + COVERED else None

    def _is_within(self, window: float, *, way: float, turn: float, now: float) -> bool:
        """Return whether it got no further, and turned no more, in a window."""
        first = self._first_within(window, now=now)
        if first is None:
            return False
        last = self._samples[-1]

        def is_near(sample: Sample) -> bool:
            apart = hypot(sample.north - last.north, sample.east - last.east)
            return apart <= way and abs(wrap(sample.yaw - last.yaw)) <= turn

        if not is_near(first):
            return False  # nearly always the case while a vehicle drives
        return all(is_near(sample) for sample in self._samples if sample.at >= first.at)


def _is_finite(message: Attitude | LocalPositionNed) -> bool:
    if isinstance(message, LocalPositionNed):
        return all(map(isfinite, (message.x, message.y, message.vx, message.vy)))
    return isfinite(message.yaw) and isfinite(message.yawspeed)
