"""Detects that a vehicle does not move as it was told to, and makes it stand.

It checks with each setpoint that a vehicle told to drive is not faster than asked, and that one
told to stand does so. The same stop ladder serves everything that ends motion: STOP, cancel, pause,
a task that is starting, the end of the server. Its steps, and when the next one is due:

1. SETPOINTS: the set-point that means "stand", while the vehicle measurably slows down. They have
   no effect if somebody holds the throttle stick, in a mode of the vehicle's own, or on an
   autopilot that has stopped listening.
2. HOLD, as soon as set-points have no effect. It is not always the first step, because an ArduPilot
   that steers as a car rolls freely in HOLD: 2.2 m from 1 m/s were measured, 1.0 m with set-points.
3. DISARM, if the vehicle still moves, and gets no slower, 2 s after HOLD was seen: a frozen output
   drives a rover in circles in HOLD. A setting switches this step off.

The ladder uses the displacement, because the reported speed of a standing vehicle is off by up to
0.6 m/s. It ends when the vehicle stands, or when somebody else drives it.

An ArduPilot in GUIDED adds the throttle stick to the speed that it is asked for: 6 m/s were
measured where 1 was asked for. The lesser of two speeds is compared, by displacement and as
reported, because a corrected position or a wrong velocity alone is no motion.
"""

from collections import deque
from enum import IntEnum
from math import inf
from operator import itemgetter
from typing import NamedTuple

from mav_tasks.engine.services.orders import Phase
from mav_tasks.engine.vehicles.control import Event
from mav_tasks.engine.vehicles.parts import Parts
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.view import Demand, DemandKind, VehicleView

NEARLY_STANDS = 0.1  # m/s; a vehicle that rolls on in HOLD from this speed rolls at most 5 cm
SWINGS = 1.0  # s in which a car may swing back, up to 0.15 m/s, after its task's zeros (ArduPilot)
RUNS_ON = 0.4  # m/s on a task's zeros, more than a wound-up speed loop explains
ROLLS = 0.03  # m/s above which one that rolls out still brakes; with 0.05 it rolled on for 9 cm
BRAKES_WITHIN = 2.0  # s to stop from 2 m/s at 1 m/s²; after that, HOLD takes over
SPEED_WINDOW = 0.3  # s of positions from which its speed is computed
REACTION = (
    0.3  # s until a rover is a tenth slower: 0.06 to 0.28 were measured, and readings lag behind it
)
NO_EFFECT = 0.3  # s without getting slower, after which the next step is due
SLOWER = 0.03  # m/s less in that time counts as slower: 0.1 m/s², less than the weakest brakes gave
ROLLS_OUT = 1.0  # s without getting slower in HOLD; a freely rolling one loses 0.14 m/s in it
MOVES = 0.15  # m/s; a slower vehicle cannot be told from estimator noise at rest
LATELY = 1.0  # s, in which the fastest speed asked for counts: a rover slows down with a delay
#: times the speed asked for, plus m/s. Measured: 1.37 times on a healthy rover, and 0.9 m/s where
#: 0.2 was asked for on a PX4 whose speed loop had wound up (RO_SPEED_I 0.5)
OVERSHOOT, NOISE = 2.0, 0.6
#: what it stands for while a task continues or starts
GOES_ON = (DemandKind.TAKE, DemandKind.DRIVE)
LASTS = 0.2  # s that it must last; with the speed's window it is seen within 0.5 s


_speed = itemgetter(1)


class Step(IntEnum):
    """The step that the ladder has reached."""

    #: the vehicle is not told to stand, or it stands
    OFF = 0
    SETPOINTS = 1
    HOLD = 2
    DISARM = 3


class Seen(NamedTuple):
    """A finding that the control table decides about."""

    event: Event
    reason: TaskReason
    words: str


class MotionGuard:
    """Guards the motion of one vehicle, and makes it stand."""

    def __init__(self, parts: Parts) -> None:
        self._parts = parts
        self._motion = parts.where
        self.step = Step.OFF
        self._began = 0.0
        self._speeds: deque[tuple[float, float]] = deque()  # (s, m/s) of the last NO_EFFECT s
        self._slowed_at = 0.0
        self._hold_seen_at = inf
        self._asked: deque[tuple[float, float]] = deque()  # (s, m/s) asked for LATELY
        self._fast_since = inf
        self._told_to_move_at = -inf

    def __repr__(self) -> str:
        return f"MotionGuard({self.step.name}, too fast since {self._fast_since})"

    @property
    def is_on(self) -> bool:
        """Whether the vehicle was told to stand and is not yet known to stand."""
        return self.step is not Step.OFF

    def begin(self, *, now: float) -> None:
        """Tell the vehicle to stand from now on; has no effect if the ladder is on."""
        if not self.is_on:
            self.step = Step.SETPOINTS
            self._began = self._slowed_at = now
            self._speeds.clear()
            self._hold_seen_at = inf

    def is_slowing(self, *, now: float) -> bool:
        """Return whether set-points still slow the vehicle down."""
        return self.step is Step.SETPOINTS and now - self._slowed_at <= NO_EFFECT

    def told_to_move(self, *, now: float) -> None:
        """Note that it was told to move just now, if not by this run."""
        self._told_to_move_at = now

    def brakes(self, *, rolls_out: bool, now: float) -> bool:
        """Return whether it was told to move a moment ago, and still rolls along its heading.

        At rest an estimate drifts for longer, and in the reported speed or the position, not both.
        """
        motion, moved = self._motion.latest(), self._displacement(now=now)
        if motion is None or moved is None or now - self._told_to_move_at > BRAKES_WITHIN:
            return False
        return min(abs(moved[1]), abs(motion.forward)) > (ROLLS if rolls_out else MOVES)

    def look(self, demand: Demand, seen: VehicleView, *, is_deaf: bool, now: float) -> list[Seen]:
        """Do what is due now, and return the findings that concern a task.

        ``is_deaf``: somebody may have taken it over, which HOLD would undo.
        """
        parts, control, asked = self._parts, self._parts.control, demand.velocity
        moved, active = self._displacement(now=now), parts.tasks.active
        speed = None if moved is None else moved[0]
        found, in_control = [], control.in_control
        may_drive = in_control and not parts.tasks.is_stopped
        words = self._why_too_fast(asked.forward, speed, now=now) if may_drive else ""
        if words and active is not None and active.state is TaskState.EXECUTING:
            found.append(Seen(Event.TOO_FAST, TaskReason.OVERSPEED, words))
        is_ours = in_control or control.phase in (Phase.RELEASING, Phase.STOPPING)
        if in_control and not asked.is_zero:
            self.told_to_move(now=now)
            self.step = Step.OFF
        elif is_ours and parts.monitor.armed and not seen.still:
            self.begin(now=now)
        if self.is_on:
            found += self._climb(demand, seen, speed, is_deaf=is_deaf, now=now)
        return found

    def _climb(
        self,
        demand: Demand,
        seen: VehicleView,
        speed: float | None,
        *,
        is_deaf: bool,
        now: float,
    ) -> list[Seen]:
        """Go on to the next step if it is due."""
        parts, control, persona = self._parts, self._parts.control, self._parts.persona
        is_held = parts.monitor.custom_mode == persona.hold_mode
        if seen.still or not seen.heard or not (control.is_engaged or is_held):
            self.step = Step.OFF  # somebody else drives it
            return []
        is_stopping = control.phase is Phase.STOPPING
        if speed is None and not is_stopping:
            return []  # keep sending zeros, then HOLD: a car might roll on in HOLD
        self._note_speed(speed, now=now)
        if is_held:
            self._hold_seen_at = min(self._hold_seen_at, now)
        goes_on = demand.kind in GOES_ON
        patience, moves = (NO_EFFECT, MOVES) if is_stopping or not goes_on else (SWINGS, RUNS_ON)
        unslowed = now - self._slowed_at
        wants_hold = (
            self.step is Step.SETPOINTS
            and now - self._began >= REACTION + patience
            and (speed is None or (speed > moves and unslowed >= patience))
        )
        if wants_hold or (self.step is Step.SETPOINTS and is_held):
            self.step = Step.HOLD
        if wants_hold and goes_on:
            words = "does not stop on zero setpoints: HOLD is set"
            return [Seen(Event.NOT_STANDING, TaskReason.STOP_UNCONFIRMED, words)]
        if (
            self.step is Step.HOLD
            and not wants_hold
            and now - self._hold_seen_at >= (parts.settings.watch.disarm_moving or inf)
            and unslowed >= ROLLS_OUT
            and speed is not None
            and speed > MOVES
        ):
            self.step = Step.DISARM
            if parts.monitor.armed:
                parts.note(f"still moves in HOLD ({speed:.1f} m/s): disarmed", now=now)
                control.disarm_now(now=now)
            return []
        # it is so slow that HOLD does not let it roll
        ends = is_stopping or (persona.rolls_out and not goes_on)
        is_slow = ends and speed is not None and speed < NEARLY_STANDS
        if control.in_control and (wants_hold or is_slow):
            if not is_deaf:
                control.begin_release(now=now)
        elif is_slow or (wants_hold and is_stopping):
            control.hold_now(now=now)
        return []

    def _note_speed(self, speed: float | None, *, now: float) -> None:
        if speed is None:
            return
        speeds = self._speeds
        while speeds and speeds[0][0] < now - NO_EFFECT - 1e-9:
            speeds.popleft()
        speeds.append((now, speed))
        if speed <= MOVES or speed < speeds[0][1] - SLOWER:
            self._slowed_at = now

    def _why_too_fast(self, asked: float, speed: float | None, *, now: float) -> str:
        """Return in words that it has been too fast for what it was asked for, else ""."""
        self._asked.append((now, abs(asked)))
        while self._asked[0][0] < now - LATELY:
            self._asked.popleft()
        most, motion = max(map(_speed, self._asked)), self._motion.latest()
        slower = 0.0 if speed is None or motion is None else min(speed, motion.speed)
        if most == 0.0 or slower <= OVERSHOOT * most + NOISE:  # the ladder checks standing
            self._fast_since = inf
            return ""
        self._fast_since = min(self._fast_since, now)
        if now - self._fast_since < LASTS:
            return ""
        return f"drives {speed:.1f} m/s instead of {most:.1f}: stopped. Is a stick off centre?"

    def _displacement(self, *, now: float) -> tuple[float, float] | None:
        """Return the speed by displacement, and along its heading, m/s; None: no fresh data."""
        is_fresh = self._motion.is_fresh(now=now)
        return self._motion.displacement(SPEED_WINDOW, now=now) if is_fresh else None
