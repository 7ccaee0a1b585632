"""How a vehicle that is told to stand is made to: set-points, then HOLD, then disarming.

One ladder for everything that ends motion: STOP, cancel, pause, a task that is starting, the
server's end. Its steps, and what leads from one to the next:

1. SETPOINTS: the set-point that means "stand", for as long as the vehicle measurably slows down.
   They do nothing where somebody holds the throttle stick, in a mode of the vehicle's own, or on an
   autopilot that has stopped listening.
2. HOLD, as soon as set-points have no effect. An ArduPilot that steers as a car rolls on freely in
   it (2.2 m from 1 m/s were measured, 1.0 m with set-points): so it is not always the first step.
3. DISARM, when it still moves, and no slower, 2 s after HOLD was seen: a frozen output drives a
   rover in circles in HOLD. A setting switches this step off.

The ladder only says which step it is; it goes by displacement, for the reported speed of a standing
vehicle is off by up to 0.6 m/s. It ends when the vehicle stands, or when
somebody else drives it.
"""

from collections import deque
from enum import IntEnum

REACTION = (
    0.3  # s until a rover is a tenth slower: 0.06 to 0.28 were measured, and what is read lags
)
NO_EFFECT = 0.3  # s without getting slower, after which the next step is due
SLOWER = 0.03  # m/s less in that time is slower: 0.1 m/s², less than the weakest brakes did
ROLLS_OUT = 1.0  # s without getting slower in HOLD; one that rolls out freely loses 0.14 m/s in it
MOVES = 0.15  # m/s; slower than this is not told from the noise of an estimator at rest


class Step(IntEnum):
    """How far the ladder has been climbed."""

    #: nothing is told to stand, or it does
    OFF = 0
    SETPOINTS = 1
    HOLD = 2
    DISARM = 3


class StopLadder:
    """The ladder of one vehicle."""

    def __init__(self) -> None:
        self.step = Step.OFF
        self._began = 0.0
        self._speeds: deque[tuple[float, float]] = deque()  # when, m/s: of the last NO_EFFECT
        self._slowed_at = 0.0
        self._hold_seen_at: float | None = None

    def __repr__(self) -> str:
        return f"StopLadder({self.step.name})"

    @property
    def is_on(self) -> bool:
        """Whether it is not known yet that the vehicle stands."""
        return self.step is not Step.OFF

    def begin(self, *, now: float) -> None:
        """The vehicle is told to stand from now on; does nothing to a ladder that is on."""
        if self.is_on:
            return
        self.step = Step.SETPOINTS
        self._began = self._slowed_at = now
        self._speeds.clear()
        self._hold_seen_at = None

    def end(self) -> None:
        """The vehicle stands, is told to move, or is somebody else's."""
        self.step = Step.OFF

    def is_slowing(self, *, now: float) -> bool:
        """Return whether set-points are still having their effect."""
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
        """Return the step to which the ladder climbs now; None: it stays where it is.

        ``speed`` is m/s by displacement, None where nothing fresh is known of it; ``is_held``
        whether the vehicle shows HOLD. ``disarm_after`` is in s after HOLD was seen, ``patience``
        in s without getting slower, after which set-points have no effect, if it is faster than
        ``moves`` m/s.
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
