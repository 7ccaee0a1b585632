"""Whether a vehicle stands, by its recent positions, against a noise floor that is learnt.

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
from math import cos, hypot, sin
from typing import NamedTuple

from mav_tasks.settings import Watch
from mav_tasks.tasks.driving.guidance import Motion, wrap

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


class Standstill:
    """The last seconds of one vehicle's motion, and its noise at rest."""

    def __init__(self) -> None:
        self._samples: deque[Sample] = deque()
        self._rests_since: float | None = None  # told to stand without a break since then
        self._way = 0.0  # m in a second, learnt at rest
        self._speed = 0.0  # m/s reported, learnt at rest
        self._learnt_at = 0.0

    def __repr__(self) -> str:
        return f"Standstill(at rest {self._way:.3f} m in a second, {self._speed:.3f} m/s)"

    @property
    def least_way(self) -> float:
        """The metres in a second that a standing vehicle may seem to move."""
        return min(MOST_WAY, max(LEAST_WAY, MARGIN * self._way))

    @property
    def least_speed(self) -> float:
        """The speed that a standing vehicle may report, m/s."""
        return min(MOST_SPEED, max(LEAST_SPEED, MARGIN * self._speed))

    def forget(self) -> None:
        """Forget the positions, as after a restart of the vehicle; the noise is kept."""
        self._samples.clear()
        self._rests_since = None

    def told_to_stand(self, *, now: float) -> None:
        """Note that everything that may move the vehicle tells it to stand, or it is disarmed."""
        if self._rests_since is None:
            self._rests_since = now

    def may_move(self) -> None:
        """Note that somebody may have told the vehicle to move: learning pauses."""
        self._rests_since = None

    def receive(self, motion: Motion, *, now: float) -> None:
        """Note where the vehicle is now."""
        samples = self._samples
        if samples and now - samples[-1].at < SPACING:
            return
        pose = motion.pose
        samples.append(Sample(now, pose.north, pose.east, pose.yaw, motion.speed))
        while samples[0].at < now - KEPT:
            samples.popleft()
        if self._rests_since is not None and now - self._rests_since > REST:
            self._learn(now)

    def has_stood(self, watch: Watch, *, now: float) -> bool:
        """Return whether it got nowhere for a second, although it may report a speed."""
        window = max(WINDOW, watch.still_time)
        samples = self._samples
        if not samples or samples[-1].speed > self.least_speed:
            return False
        return self._is_within(
            window, way=self.least_way * window, turn=watch.still_turn_rate * window, now=now
        )

    def confirms(self, watch: Watch, *, now: float) -> bool:
        """Return whether the displacement agrees with reports that it stood for ``still_time``."""
        window = watch.still_time
        way = 1.2 * max(watch.still_speed, self.least_way) * window
        return self._is_within(window, way=way, turn=2 * watch.still_turn_rate * window, now=now)

    def speed(self, window: float, *, now: float) -> float | None:
        """Return m/s by displacement over a window up to now, or None if it is not covered."""
        first = self._first_within(window, now=now)
        if first is None:
            return None
        last = self._samples[-1]
        took = last.at - first.at
        return hypot(last.north - first.north, last.east - first.east) / took if took > 0 else None

    def forward(self, window: float, *, now: float) -> float | None:
        """Return m/s along its heading by displacement, or None if the window is not covered."""
        first = self._first_within(window, now=now)
        if first is None:
            return None
        last = self._samples[-1]
        north, east, took = last.north - first.north, last.east - first.east, last.at - first.at
        return (north * cos(last.yaw) + east * sin(last.yaw)) / took if took > 0 else None

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
        first = self._first_within(window, now=now)
        if first is None:
            return False
        last = self._samples[-1]
        if _apart(first, last) > way or abs(wrap(first.yaw - last.yaw)) > turn:
            return False  # nearly always the case while a vehicle drives
        since = first.at
        return all(
            _apart(sample, last) <= way and abs(wrap(sample.yaw - last.yaw)) <= turn
            for sample in self._samples
            if sample.at >= since
        )

    def _learn(self, now: float) -> None:
        drift, way = self.speed(REST, now=now), self.speed(WINDOW, now=now)
        if drift is None or way is None or drift > DRIFT:
            return
        kept = max(0.0, 1.0 - (now - self._learnt_at) / FORGETS)
        self._learnt_at = now
        self._way = max(min(way, MOST_WAY), self._way * kept)
        self._speed = max(min(self._samples[-1].speed, MOST_SPEED), self._speed * kept)


def _apart(one: Sample, other: Sample) -> float:
    return hypot(one.north - other.north, one.east - other.east)
