"""When things leave: answers a little late, positions two at a time, as the real ones send them."""

from random import Random

from rover_sim.motion import CONTROL_PERIOD
from rover_sim.realism import LinkTiming

# Recorded at 40 Hz asked for: 20, 20, 20, 40 ms. With steps of 25 ms every eighth is late by one
HELD_BACK = 0.125
HELD_LONGER = 0.01  # of all, by two: recorded were up to 88 ms
# Most answers are as fast as they can be: recorded p50 / max 4 / 62 ms (PX4), 11 / 24 (ArduPilot)
PROMPTNESS = 8


class Departures:
    """Decides when a message leaves. None of it is by chance but the seed's."""

    def __init__(self, timing: LinkTiming | None, *, seed: int) -> None:
        self._timing = timing
        self._chance = Random(seed)
        self._held_until = self._last_answer = float("-inf")

    def __repr__(self) -> str:
        return f"Departures({self._timing})"

    def answer_at(self, *, now: float) -> float:
        """Return when the answer leaves to what has come now: never before an earlier answer."""
        if self._timing is None:
            return now
        least, most = self._timing.first_answer, self._timing.last_answer
        delay = least + (most - least) * self._chance.random() ** PROMPTNESS
        self._last_answer = max(now + delay, self._last_answer)
        return self._last_answer

    def position_at(self, *, now: float) -> float:
        """Return when a position leaves that is due now."""
        if self._timing is None or not self._timing.in_pairs:
            return now
        if now < self._held_until - CONTROL_PERIOD / 2:
            return self._held_until  # not before the one that is held back
        drawn = self._chance.random()
        if drawn >= HELD_BACK:
            return now
        self._held_until = now + CONTROL_PERIOD * (2 if drawn < HELD_LONGER else 1)
        return self._held_until
