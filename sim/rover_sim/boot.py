"""The first seconds of an autopilot: which estimates are still missing, and why it refuses to arm.

``BootTimes`` has the times, each make's ``BootScript`` the texts; both were recorded.
"""

from dataclasses import dataclass

from rover_sim.realism import BootTimes


@dataclass(frozen=True, slots=True)
class BootScript:
    """Texts and mode behaviour of one make during its boot."""

    refusals: tuple[tuple[float, tuple[str, ...]], ...]  # (end as a part of ``armable``, texts)
    texts: tuple[tuple[str, str], ...]  # (the field of BootTimes after which it is said, text)
    keeps_to_its_first_mode: bool  # ArduPilot: a mode that is entered early is lost


class Boot:
    """One boot, from power-on at ``started``."""

    def __init__(self, times: BootTimes, script: BootScript, *, started: float) -> None:
        self._times = times
        self._script = script
        self._started = started
        self._unsaid = () if times.is_none else script.texts
        self._mode_to_lose = script.keeps_to_its_first_mode and not times.is_none

    def has_passed(self, time: str, now: float) -> bool:
        """Return whether one of ``BootTimes``, by its name, is over."""
        over: bool = now - self._started >= getattr(self._times, time)
        return over

    def takes_modes(self, now: float) -> bool:
        """Return whether a mode can be entered already, although it will be lost."""
        return self._mode_to_lose and self.has_passed("initialised", now)

    def is_initialised(self, now: float) -> bool:
        """Return whether INITIALISING is over."""
        return self.has_passed("initialised", now) and self.has_passed("mode_lost", now)

    def tells_its_time(self, now: float) -> bool:
        """Return whether messages with its clock are sent: an ArduPilot's not in INITIALISING."""
        return self._times.is_none or self.is_initialised(now)

    def loses_mode(self, now: float) -> bool:
        """Return True once, when a mode that was entered early is lost."""
        if not self._mode_to_lose or not self.has_passed("mode_lost", now):
            return False
        self._mode_to_lose = False
        return True

    def arming_refusal(self, now: float) -> tuple[str, ...]:
        """Return the texts that refuse arming; empty if the boot does not prevent arming."""
        part = (now - self._started) / self._times.armable
        if self._times.is_none or part >= 1.0:
            return ()
        return next(texts for end, texts in self._script.refusals if part < end)

    def texts_due(self, now: float) -> list[str]:
        """Return the texts that became due since the last call."""
        if not self._unsaid:
            return []
        due = [each for each in self._unsaid if self.has_passed(each[0], now)]
        self._unsaid = tuple(each for each in self._unsaid if each not in due)
        return [text for _, text in due]
