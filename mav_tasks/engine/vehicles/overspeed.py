"""Whether a vehicle drives faster than it was told to: somebody adds to it, or it runs away.

An ArduPilot in GUIDED adds the throttle stick to the speed that it is asked for: 6 m/s were
measured where 1 was asked for. What is compared is the least of two speeds, by displacement and as
reported: a position that is corrected, or a velocity that is off, is no motion.
"""

from collections import deque

LATELY = 1.0  # s, in which the fastest speed asked for counts: a rover slows down later than asked
#: times what was asked for, and m/s more: 1.37 times were measured on a healthy rover, and 0.9 m/s
#: where 0.2 was asked for on a PX4 whose speed loop had wound up (RO_SPEED_I 0.5)
OVERSHOOT, NOISE = 2.0, 0.6
LASTS = 0.2  # s that it must last; with the window of the speed it is seen within 0.5 s


class Overspeed:
    """The speeds that one vehicle was asked for lately."""

    def __init__(self) -> None:
        self._asked: deque[tuple[float, float]] = deque()
        self._since: float | None = None

    def __repr__(self) -> str:
        return f"Overspeed(since={self._since})"

    def look(self, asked: float, speed: float, *, now: float) -> float | None:
        """Return the m/s that were asked for, if it has been driving too fast for that.

        ``asked`` is what is asked for now and ``speed`` what was measured, m/s.
        """
        self._asked.append((now, abs(asked)))
        while self._asked[0][0] < now - LATELY:
            self._asked.popleft()
        most = max(each for _, each in self._asked)
        if most == 0.0 or speed <= OVERSHOOT * most + NOISE:  # told to stand: ``stop_ladder``'s
            self._since = None
            return None
        if self._since is None:
            self._since = now
        return most if now - self._since >= LASTS else None
