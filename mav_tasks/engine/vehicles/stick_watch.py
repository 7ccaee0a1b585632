"""Whether a stick of a vehicle's own transmitter leaves neutral, by RC_CHANNELS.

An ArduPilot in GUIDED takes the throttle stick as a speed of its own (1.9 m/s were measured where 0
was asked for), and no other message shows that. Neutral is what the sticks show while the vehicle
is disarmed: a throttle may rest at its lowest, and a vehicle cannot be armed while its throttle is
held forward. While the vehicle is armed, a stick may be held, even if nothing drives. MAVLink
guide: RC_CHANNELS.
"""

from math import inf

from mav_tasks.mavlink.messages import RcChannels

LEAVES = 100  # µs from neutral; trims and noise are a tenth of that
TIMES = 2  # messages in a row that must show it
ABSENT = (0, 65535)  # values of a channel that is absent
FRESH = 0.5  # s, of five messages at the requested rate; an older value is unknown


class StickWatch:
    """The sticks of one vehicle: steering and throttle at the RCMAP_* defaults."""

    def __init__(self) -> None:
        self._said_at = -inf
        self.forget()

    def __repr__(self) -> str:
        return f"StickWatch(rest={self._rest})"

    def forget(self) -> None:
        """Forget neutral after a restart of the vehicle: its transmitter may be another one."""
        self._rest: tuple[int, int] | None = None
        self._times = self._throttle = 0

    def throttle(self, *, now: float) -> int:
        """Return 1 while the throttle is held forward of neutral, -1 while held back, else 0.

        The signs are swapped if the vehicle reverses the channel.
        """
        return self._throttle if now - self._said_at <= FRESH else 0

    def look(self, message: RcChannels, *, armed: bool, sent_at: float) -> bool:
        """Return whether a stick is off neutral; learn neutral while the vehicle is disarmed."""
        here, self._said_at = (message.chan1_raw, message.chan3_raw), sent_at
        if not message.chancount or any(value in ABSENT for value in here):
            self._times = self._throttle = 0
            return False
        if self._rest is None or not armed:
            self._rest, self._times, self._throttle = here, 0, 0
            return False
        steered, off = here[0] - self._rest[0], here[1] - self._rest[1]
        self._throttle = (off > LEAVES) - (off < -LEAVES)
        self._times = self._times + 1 if self._throttle or abs(steered) > LEAVES else 0
        return self._times >= TIMES
