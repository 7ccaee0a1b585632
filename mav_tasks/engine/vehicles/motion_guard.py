"""Detects that a vehicle does not move as it was told to, and decides what to do about it.

It checks with each setpoint that a vehicle told to stand does so (``stop_ladder``), and that one
told to drive is not faster than asked (``overspeed``).
"""

from enum import Enum, auto
from math import inf
from typing import NamedTuple

from mav_tasks.engine.vehicles.motion_monitor import MotionMonitor
from mav_tasks.engine.vehicles.overspeed import Overspeed
from mav_tasks.engine.vehicles.stop_ladder import MOVES, NO_EFFECT, Step, StopLadder
from mav_tasks.settings import Watch

NEARLY_STANDS = 0.1  # m/s; a vehicle that rolls on in HOLD from this speed rolls at most 5 cm
SWINGS = 1.0  # s in which a car may swing back, up to 0.15 m/s, after its task's zeros (ArduPilot)
RUNS_ON = 0.4  # m/s on a task's zeros, more than a wound-up speed loop explains
ROLLS = 0.03  # m/s above which one that rolls out still brakes; with 0.05 it rolled on for 9 cm
BRAKES_WITHIN = 2.0  # s to stop from 2 m/s at 1 m/s²; after that, HOLD takes over
SPEED_WINDOW = 0.3  # s of positions from which its speed is computed


class Measure(Enum):
    """What the guard demands."""

    #: HOLD: it is so slow that HOLD does not let it roll
    HOLD_NOW = auto()
    #: HOLD: setpoints do not stop it
    HOLD = auto()
    #: disarm: HOLD does not stop it either
    DISARM = auto()
    #: stop the task: it is faster than it was told to be
    STOP_TASK = auto()


class Found(NamedTuple):
    """A measure, and the observation in words for the operator."""

    measure: Measure
    words: str = ""


class Told(NamedTuple):
    """What the vehicle is told, and who controls it."""

    forward: float  # m/s asked for now
    moves: bool  # we ask for a velocity other than zero, and it is in our control
    is_ours: bool  # we drive it, hand it back or stop it
    is_stopping: bool  # by STOP, or by a halt like it
    rolls_out: bool  # in our mode, it rolls on or swings back before it stands
    may_drive: bool  # it is in our control, and STOP is not latched
    goes_on: bool  # it stands for a task that continues or starts
    is_released: bool  # we send it nothing any more
    is_held: bool  # it shows HOLD
    armed: bool
    still: bool
    heard: bool


class MotionGuard:
    """Guards the motion of one vehicle."""

    def __init__(self, motion: MotionMonitor, watch: Watch) -> None:
        self._motion = motion
        self._watch = watch
        self.ladder = StopLadder()
        self._overspeed = Overspeed()
        self._told_to_move_at = -inf

    def __repr__(self) -> str:
        return f"MotionGuard({self.ladder!r}, {self._overspeed!r})"

    def apply(self, watch: Watch) -> None:
        self._watch = watch

    def told_to_move(self, *, now: float) -> None:
        """Note that it was told to move just now, if not by this run."""
        self._told_to_move_at = now

    def is_fresh(self, *, now: float) -> bool:
        """Return whether there is fresh data on how the vehicle moves."""
        motion = self._motion.latest()
        return motion is not None and now - motion.at <= self._watch.motion_fresh

    def brakes(self, *, rolls_out: bool, now: float) -> bool:
        """Return whether it was told to move a moment ago, and still rolls along its heading.

        At rest an estimate drifts for longer, and in the reported speed or the position, not both.
        """
        motion = self._motion.latest()
        if motion is None or now - self._told_to_move_at > BRAKES_WITHIN:
            return False
        least = ROLLS if rolls_out else MOVES
        forward = self._motion.standstill.forward(SPEED_WINDOW, now=now)
        is_known = forward is not None and self.is_fresh(now=now)
        return is_known and min(abs(forward or 0.0), abs(motion.forward)) > least

    def look(self, told: Told, *, now: float) -> list[Found]:
        """Return the measures that are due now, in order."""
        found = []
        if told.may_drive:
            too_fast = self._is_too_fast(told.forward, now=now)
            if too_fast:
                found.append(Found(Measure.STOP_TASK, too_fast))
        if told.moves:
            self.told_to_move(now=now)
            self.ladder.end()
        elif told.is_ours and told.armed and not told.still:
            self.ladder.begin(now=now)
        if self.ladder.is_on:
            found += self._climb(told, now=now)
        return found

    def _climb(self, told: Told, *, now: float) -> list[Found]:
        if told.still or not told.heard or (told.is_released and not told.is_held):
            self.ladder.end()
            return []
        speed = self._speed(now=now)
        if speed is None and not told.is_stopping:
            return []  # keep sending zeros, then HOLD: a car might roll on in HOLD
        is_own = told.goes_on and not told.is_stopping
        step = self.ladder.climb(
            speed=speed,
            is_held=told.is_held,
            patience=SWINGS if is_own else NO_EFFECT,
            moves=RUNS_ON if is_own else MOVES,
            disarm_after=self._watch.disarm_moving or inf,
            now=now,
        )
        if step is Step.HOLD:
            return [Found(Measure.HOLD)]
        if step is Step.DISARM and told.armed:
            return [
                Found(Measure.DISARM, f"still moves in HOLD ({speed or 0.0:.1f} m/s): disarmed")
            ]
        ends = told.is_stopping or (told.rolls_out and not told.goes_on)
        if ends and speed is not None and speed < NEARLY_STANDS:
            return [Found(Measure.HOLD_NOW)]
        return []

    def _is_too_fast(self, asked: float, *, now: float) -> str:
        speed, motion = self._speed(now=now), self._motion.latest()
        reported = 0.0 if motion is None else motion.speed
        most = self._overspeed.look(asked, min(speed or 0.0, reported), now=now)
        if most is None:
            return ""
        return f"drives {speed:.1f} m/s instead of {most:.1f}: stopped. Is a stick off centre?"

    def _speed(self, *, now: float) -> float | None:
        """Return the speed by displacement, m/s, or None without fresh data."""
        return (
            self._motion.standstill.speed(SPEED_WINDOW, now=now) if self.is_fresh(now=now) else None
        )
