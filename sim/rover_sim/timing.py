"""Send times: answers are slightly late, positions come two at a time, as recorded."""

from random import Random

from rover_sim.motion import CONTROL_PERIOD
from rover_sim.realism import LinkTiming

# Recorded at 40 Hz: intervals of 20, 20, 20, 40 ms. With steps of 25 ms, every eighth is late by
# one
HELD_BACK = 0.125
HELD_LONGER = 0.01  # of all positions, late by two steps: up to 88 ms were recorded
# Most answers take the least delay: recorded p50 / max 4 / 62 ms (PX4), 11 / 24 (ArduPilot)
PROMPTNESS = 8


class Departures:
    """Decides when a message leaves; deterministic for a given seed."""

    def __init__(self, timing: LinkTiming, *, seed: int) -> None:
        self._timing = timing
        self._chance = Random(seed)
        self._held_until = self._last_answer = float("-inf")

    def answer_at(self, now: float) -> float:
        """Return when the answer to a present command leaves: never before an earlier answer."""
        least, most = self._timing.first_answer, self._timing.last_answer
        delay = least + (most - least) * self._chance.random() ** PROMPTNESS
        self._last_answer = max(now + delay, self._last_answer)
        return self._last_answer

    def position_at(self, now: float) -> float:
        """Return when a position that is due now leaves."""
        if not self._timing.in_pairs:
            return now
        if now < self._held_until - CONTROL_PERIOD / 2:
            return self._held_until  # not before the delayed position
        drawn = self._chance.random()
        if drawn >= HELD_BACK:
            return now
        self._held_until = now + CONTROL_PERIOD * (2 if drawn < HELD_LONGER else 1)
        return self._held_until
