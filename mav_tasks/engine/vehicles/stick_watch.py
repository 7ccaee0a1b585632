"""Whether the sticks of a vehicle's own transmitter leave neutral, by RC_CHANNELS.

An ArduPilot in GUIDED takes the throttle stick for a speed of its own (1.9 m/s were measured where
0 was asked for), and says so nowhere else. Where the sticks rest is what they show while the
vehicle is disarmed: a throttle may rest at its lowest, and none is armed while it is held forward.
What they show while it is armed may be held, also while nothing drives. MAVLink guide: RC_CHANNELS.
"""

from math import inf

from mav_tasks.mavlink.messages import RcChannels

LEAVES = 100  # µs from where it rests; trims and noise are a tenth of that
TIMES = 2  # messages in a row
ABSENT = (0, 65535)  # a channel without a value
FRESH = 0.5  # s, of five messages as they are asked for; older than this nobody knows


class StickWatch:
    """The sticks of one vehicle: steering and throttle, as RCMAP_* has them by default."""

    def __init__(self) -> None:
        self._rest: tuple[int, int] | None = None
        self._times = 0
        self._throttle = 0
        self._said_at = -inf

    def __repr__(self) -> str:
        return f"StickWatch(rest={self._rest})"

    def forget(self) -> None:
        """The vehicle has restarted: its transmitter may be another one."""
        self._rest, self._times, self._throttle = None, 0, 0

    def throttle(self, *, now: float) -> int:
        """Return 1 while the throttle is held forward of where it rests, -1 while back, else 0.

        A channel that is reversed on the vehicle has it the other way round.
        """
        return self._throttle if now - self._said_at <= FRESH else 0

    def look(self, message: RcChannels, *, armed: bool, sent_at: float) -> bool:
        """Return whether a stick is away from where it rests, which is learnt while disarmed."""
        here, self._said_at = (message.chan1_raw, message.chan3_raw), sent_at
        if not message.chancount or any(value in ABSENT for value in here):
            self._times = self._throttle = 0
            return False
        if self._rest is None or not armed:
            self._rest, self._times, self._throttle = here, 0, 0
            return False
        off = here[1] - self._rest[1]
        self._throttle = (off > LEAVES) - (off < -LEAVES)
        moved = any(
            abs(value - rest) > LEAVES for value, rest in zip(here, self._rest, strict=True)
        )
        self._times = self._times + 1 if moved else 0
        return self._times >= TIMES
