"""How a vehicle is made to stand: set-points, then HOLD, then disarming.

The same ladder serves everything that ends motion: STOP, cancel, pause, a task that is starting,
the end of the server. Its steps, and when the next one is due:

1. SETPOINTS: the set-point that means "stand", while the vehicle measurably slows down. They have
   no effect if somebody holds the throttle stick, in a mode of the vehicle's own, or on an
   autopilot that has stopped listening.
2. HOLD, as soon as set-points have no effect. It is not always the first step, because an ArduPilot
   that steers as a car rolls freely in HOLD: 2.2 m from 1 m/s were measured, 1.0 m with set-points.
3. DISARM, if the vehicle still moves, and gets no slower, 2 s after HOLD was seen: a frozen output
   drives a rover in circles in HOLD. A setting switches this step off.

The ladder only says which step it is. It uses the displacement, because the reported speed of a
standing vehicle is off by up to 0.6 m/s. It ends when the vehicle stands, or when somebody else
drives it.
"""

from collections import deque
from enum import IntEnum

REACTION = (
    0.3  # s until a rover is a tenth slower: 0.06 to 0.28 were measured, and readings lag behind it
)
NO_EFFECT = 0.3  # s without getting slower, after which the next step is due
SLOWER = 0.03  # m/s less in that time counts as slower: 0.1 m/s², less than the weakest brakes gave
ROLLS_OUT = 1.0  # s without getting slower in HOLD; a freely rolling one loses 0.14 m/s in it
MOVES = 0.15  # m/s; a slower vehicle cannot be told from estimator noise at rest


class Step(IntEnum):
    """The step that the ladder has reached."""

    #: the vehicle is not told to stand, or it stands
    OFF = 0
    SETPOINTS = 1
    HOLD = 2
    DISARM = 3


class StopLadder:
    """The stop ladder of one vehicle."""

    def __init__(self) -> None:
        self.step = Step.OFF
        self._began = 0.0
        self._speeds: deque[tuple[float, float]] = deque()  # (s, m/s) of the last NO_EFFECT s
        self._slowed_at = 0.0
        self._hold_seen_at: float | None = None

    def __repr__(self) -> str:
        return f"StopLadder({self.step.name})"

    @property
    def is_on(self) -> bool:
        """Whether the vehicle was told to stand and is not yet known to stand."""
        return self.step is not Step.OFF

    def begin(self, *, now: float) -> None:
        """Tell the vehicle to stand from now on; has no effect if the ladder is on."""
        if self.is_on:
            return
        self.step = Step.SETPOINTS
        self._began = self._slowed_at = now
        self._speeds.clear()
        self._hold_seen_at = None

    def end(self) -> None:
        """End the ladder: the vehicle stands, is told to move, or somebody else has it."""
        self.step = Step.OFF

    def is_slowing(self, *, now: float) -> bool:
        """Return whether set-points still slow the vehicle down."""
        return self.step is Step.SETPOINTS and now - self._slowed_at <= NO_EFFECT

    def climb(
        self,
        *,
        speed: float | None,
        is_held: bool,
        disarm_after: float,
        now: float,
        patience: float = NO_EFFECT,
        moves: float = MOVES,
    ) -> Step | None:
        """Return the step to which the ladder climbs now, or None if it stays where it is.

        ``speed`` is by displacement, m/s, or None without fresh data. ``is_held`` says whether the
        vehicle shows HOLD. ``disarm_after`` is in s after HOLD was seen. Set-points have no effect
        if it is faster than ``moves`` m/s and no slower after ``patience`` s.
        """
        self._look(speed, now)
        if is_held and self._hold_seen_at is None:
            self._hold_seen_at = now
        if self.step is Step.SETPOINTS and self._has_no_effect(speed, patience, moves, now):
            self.step = Step.HOLD
            return Step.HOLD
        if self.step is Step.SETPOINTS and is_held:
            self.step = Step.HOLD
        is_due = (
            self.step is Step.HOLD
            and self._hold_seen_at is not None
            and now - self._hold_seen_at >= disarm_after
            and now - self._slowed_at >= ROLLS_OUT
            and speed is not None
            and speed > MOVES
        )
        if not is_due:
            return None
        self.step = Step.DISARM
        return Step.DISARM

    def _has_no_effect(
        self, speed: float | None, patience: float, moves: float, now: float
    ) -> bool:
        if now - self._began < REACTION + patience:
            return False
        if speed is None:
            return True
        return speed > moves and now - self._slowed_at >= patience

    def _look(self, speed: float | None, now: float) -> None:
        if speed is None:
            return
        speeds = self._speeds
        while speeds and speeds[0][0] < now - NO_EFFECT - 1e-9:
            speeds.popleft()
        speeds.append((now, speed))
        if speed <= MOVES or speed < speeds[0][1] - SLOWER:
            self._slowed_at = now
