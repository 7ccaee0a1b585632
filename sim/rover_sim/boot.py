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

    def __repr__(self) -> str:
        return f"Boot({len(self._unsaid)} texts to come)"

    def takes_modes(self, *, now: float) -> bool:
        """Return whether a mode can be entered already, although it will be lost."""
        return self._mode_to_lose and now - self._started >= self._times.initialised

    def is_initialised(self, *, now: float) -> bool:
        """Return whether INITIALISING is over."""
        return now - self._started >= max(self._times.initialised, self._times.mode_lost)

    def tells_its_time(self, *, now: float) -> bool:
        """Return whether messages with its clock are sent: an ArduPilot's not in INITIALISING."""
        return self._times.is_none or self.is_initialised(now=now)

    def loses_mode(self, *, now: float) -> bool:
        """Return True once, when a mode that was entered early is lost."""
        if not self._mode_to_lose or now - self._started < self._times.mode_lost:
            return False
        self._mode_to_lose = False
        return True

    def has_heading(self, *, now: float) -> bool:
        """Return whether the estimate has a heading."""
        return now - self._started >= self._times.heading

    def has_fix(self, *, now: float) -> bool:
        """Return whether the receiver has a position."""
        return now - self._started >= self._times.fix

    def has_position(self, *, now: float) -> bool:
        """Return whether the estimate has a position."""
        return now - self._started >= self._times.position

    def has_origin(self, *, now: float) -> bool:
        """Return whether the origin is known."""
        return now - self._started >= self._times.origin

    def is_healthy(self, *, now: float) -> bool:
        """Return whether the pre-arm checks pass."""
        return now - self._started >= self._times.healthy

    def arming_refusal(self, *, now: float) -> tuple[str, ...]:
        """Return the texts that refuse arming; empty if the boot does not prevent arming."""
        part = (now - self._started) / self._times.armable
        if self._times.is_none or part >= 1.0:
            return ()
        return next(texts for end, texts in self._script.refusals if part < end)

    def texts_due(self, *, now: float) -> list[str]:
        """Return the texts that became due since the last call."""
        if not self._unsaid:
            return []
        at = now - self._started
        due = [each for each in self._unsaid if at >= getattr(self._times, each[0])]
        self._unsaid = tuple(each for each in self._unsaid if each not in due)
        return [text for _, text in due]
