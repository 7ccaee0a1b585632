"""Detects that a vehicle drives faster than told: somebody adds speed, or it runs away.

An ArduPilot in GUIDED adds the throttle stick to the speed that it is asked for: 6 m/s were
measured where 1 was asked for. The lesser of two speeds is compared, by displacement and as
reported, because a corrected position or a wrong velocity alone is no motion.
"""

from collections import deque

LATELY = 1.0  # s, in which the fastest speed asked for counts: a rover slows down with a delay
#: times the speed asked for, plus m/s. Measured: 1.37 times on a healthy rover, and 0.9 m/s where
#: 0.2 was asked for on a PX4 whose speed loop had wound up (RO_SPEED_I 0.5)
OVERSHOOT, NOISE = 2.0, 0.6
LASTS = 0.2  # s that it must last; with the speed's window it is seen within 0.5 s


class Overspeed:
    """The speeds that one vehicle was asked for recently."""

    def __init__(self) -> None:
        self._asked: deque[tuple[float, float]] = deque()
        self._since: float | None = None

    def __repr__(self) -> str:
        return f"Overspeed(since={self._since})"

    def look(self, asked: float, speed: float, *, now: float) -> float | None:
        """Return the speed asked for, m/s, if the vehicle has been too fast for it, else None.

        ``asked`` is the speed asked for now and ``speed`` the measured one, m/s.
        """
        self._asked.append((now, abs(asked)))
        while self._asked[0][0] < now - LATELY:
            self._asked.popleft()
        most = max(each for _, each in self._asked)
        if most == 0.0 or speed <= OVERSHOOT * most + NOISE:  # ``stop_ladder`` checks standing
            self._since = None
            return None
        if self._since is None:
            self._since = now
        return most if now - self._since >= LASTS else None
