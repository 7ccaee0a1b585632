"""Where one vehicle may drive, how fast, and which rally point it returns to.

The limits on a velocity before it is sent: finite, not too fast, ramped up, clear of the fence.
Zeros pass at once and without a ramp: they are STOP, cancel and faults.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import ceil, copysign, isfinite, sqrt

from mav_tasks.config.settings import Driving
from mav_tasks.kinds import GlobalPlace, GoTo, Pose, SingleGoal
from mav_tasks.kinds.guidance import ZERO, Motion, Velocity, clamped
from mav_tasks.kinds.path import distance, pose_on, rest_of, wrap
from mav_tasks.tasks.driving.fence import Fence, LocalFence
from mav_tasks.tasks.driving.frames import local_place, to_local
from mav_tasks.tasks.driving.mission_sequencer import ways_on
from mav_tasks.tasks.driving.planner import is_allowed
from mav_tasks.tasks.goal import Step
from mav_tasks.tasks.task import Progress

MARGIN = 0.05  # m left between a vehicle and its fence
LATENCY = 0.3  # s until a vehicle does what it is told, including the age of its telemetry
USUAL_AGE = 0.05  # s of telemetry age in LATENCY; if it is older, the way since then counts
TURNS_ON = LATENCY + 0.3  # s for which a vehicle that is told to stand keeps turning
APART = 0.1  # rad, at most, between the directions that are checked
CREEP = 0.02  # m/s; less counts as standing


def within_fence(
    wish: Velocity, motion: Motion, fence: LocalFence | None, *, driving: Driving, now: float
) -> Velocity | None:
    """Return a velocity from which the vehicle can stop before the fence; None: stop now.

    It checks the room ahead, or behind in reverse, in every direction that the vehicle may point in
    until it stands. The distance driven since the measurement is deducted.
    """
    if fence is None or wish.forward == 0.0:
        return wish
    ahead = wish.forward > 0.0
    speed, braking = abs(wish.forward), driving.acceleration
    unseen = max(speed, abs(motion.forward)) * max(0.0, now - motion.at - USUAL_AGE)
    lost = unseen + MARGIN
    needed = speed * LATENCY + speed * speed / (2 * braking) + lost
    room = needed
    for yaw in _headings(wish, motion):
        room = min(room, fence.room(replace(motion.pose, yaw=yaw), forward=ahead, limit=room))
    room -= lost
    if room >= needed - lost:
        return wish
    lag = braking * LATENCY
    most = sqrt(lag * lag + 2 * braking * max(room, 0.0)) - lag
    return None if most < CREEP else replace(wish, forward=copysign(most, wish.forward))


def _headings(wish: Velocity, motion: Motion) -> list[float]:
    """Return closely spaced headings that a vehicle may have until it stands."""
    yaw = motion.pose.yaw
    if wish.course is not None:  # it turns there by itself, as fast as it can
        turns = [0.0, wrap(wish.course - yaw)]
    else:
        turns = [0.0, wish.yaw_rate * TURNS_ON, motion.yaw_rate * TURNS_ON]
    least, most = min(turns), max(turns)
    steps = ceil((most - least) / APART)
    spread = (most - least) / steps if steps else 0.0
    return [yaw, *(yaw + least + number * spread for number in range(steps + 1))]


def limited(wish: Velocity, last: Velocity, *, driving: Driving, elapsed: float) -> Velocity:
    """Return the velocity that may be sent ``elapsed`` seconds after ``last``.

    Acceleration is ramped as the settings say, deceleration is not. A number that is not finite
    becomes a stop: NaN in a velocity setpoint aborts an ArduPilot SITL.
    """
    numbers = wish.forward, wish.yaw_rate, wish.course or 0.0
    if wish.is_zero or not all(map(isfinite, numbers)):
        return ZERO
    step, turn_step = driving.acceleration * elapsed, driving.turn_acceleration * elapsed
    return Velocity(
        _ramped(clamped(wish.forward, driving.max_speed), last.forward, step),
        _ramped(clamped(wish.yaw_rate, driving.max_turn_rate), last.yaw_rate, turn_step),
        wish.course,
    )


def safe_braking(driving: Driving, speed: float, distance: float) -> float:
    """Return the deceleration to plan for if a stop from ``speed`` took ``distance``.

    It is the settings' value, or less if the stop took more room than planned. The whole distance
    counts as braking then, since a lag at low speed says little about a higher one. The result is
    never above the settings' value.
    """
    planned = driving.acceleration
    if distance <= speed * LATENCY + speed * speed / (2 * planned):
        return planned
    return min(planned, speed * speed / (2 * distance))


def _ramped(wish: float, last: float, step: float) -> float:
    if wish >= 0:
        return min(wish, max(last, 0.0) + step)
    return max(wish, min(last, 0.0) - step)


class Bounds:
    """The fence and rally points of one vehicle; ``origin`` is that of its local frame."""

    def __init__(self) -> None:
        self.fence = Fence()
        self.rally: tuple[GlobalPlace, ...] = ()
        self._local: LocalFence | None = None
        self._made_of: tuple[Fence, GlobalPlace] | None = None

    def __repr__(self) -> str:
        return f"Bounds({len(self.fence.zones)} zones, {len(self.rally)} rally points)"

    def is_unknown(self, origin: GlobalPlace | None) -> bool:
        """Return whether there is a fence whose place in the vehicle's frame is unknown."""
        return bool(self.fence.zones) and origin is None

    def local(self, origin: GlobalPlace | None) -> LocalFence | None:
        """Return the fence in the frame of an origin; None without a fence or an origin."""
        if origin is None or not self.fence.zones:
            return None
        if self._made_of != (self.fence, origin):
            self._local, self._made_of = LocalFence(self.fence, origin), (self.fence, origin)
        return self._local

    def allows(self, pose: Pose, origin: GlobalPlace | None) -> bool:
        """Return whether the vehicle may be at a pose."""
        fence = self.local(origin)
        return fence is None or fence.allows(pose)

    def metres_to_leave(
        self, goal: SingleGoal, progress: Progress, pose: Pose, origin: GlobalPlace | None
    ) -> float | None:
        """Return after how many metres the way of a goal that starts or resumes here leaves the
        fence; None: it stays inside, 0.0: at once, or somewhere in its bends.

        From outside, the way may lead back in. A goal without a place to end at is allowed, and
        watched while it drives.
        """
        fence, end = self.local(origin), goal.end_of(progress)
        if fence is None or end is None:
            return None
        if progress.path and progress.anchor is not None:
            left = rest_of(progress.path, progress.done)
            there = pose_on(progress.anchor, progress.path, progress.done)
            return None if is_allowed(there, left, fence) else 0.0
        return None if fence.escapes(pose, end) else fence.first_forbidden(pose, end)

    def forbidden_leg(self, steps: Sequence[Step], origin: GlobalPlace | None) -> int | None:
        """Return a step to which the straight way from the place before crosses the fence, or None.

        It checks the places that are known beforehand; others are checked when their step begins.
        """
        fence = self.local(origin)
        if fence is None:
            return None
        places = [
            local_place(step.place, origin) if isinstance(step, GoTo) else None for step in steps
        ]
        for number, start in enumerate(places):
            for following in _next_places(steps, number) if start else ():
                end = places[following]
                if start and end and not fence.allows_way(start, end):
                    return following
        return None

    def refuge(self, pose: Pose, origin: GlobalPlace | None) -> GlobalPlace | None:
        """Return the nearest rally point, or None."""
        if origin is None or not self.rally:
            return None
        return min(self.rally, key=lambda place: distance(pose, to_local(place, origin)))


def _next_places(steps: Sequence[Step], number: int) -> list[int]:
    """Return the steps whose places may come next, whichever jumps are taken."""
    found: list[int] = []
    seen: set[int] = set()
    waiting = [number + 1]
    while waiting:
        step = waiting.pop()
        if step in seen or not 0 <= step < len(steps):
            continue
        seen.add(step)
        if isinstance(steps[step], GoTo):
            found.append(step)
        elif steps[step].stays:
            waiting += ways_on(steps, step)
    return found
