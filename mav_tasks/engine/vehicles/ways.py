"""The places at which the id of a vehicle is heard: ways to it, or another vehicle with its id.

A place is a way to the vehicle if what answers there has its unique id, and its clock, as TIMESYNC
shows it. The server uses one way at a time, and goes on by another one if that brings packets while
the one in use is silent, or answers while the one in use does not.
"""

from dataclasses import dataclass
from math import inf

from mav_tasks.mavlink import messages as m
from mav_tasks.services.identity import uid_of

SILENT = 0.5  # s; telemetry radios delay packets by less, and position data is lost after 1 s
UNANSWERED = 3.5  # s, as heartbeats that stay away: two requests or answers in a row may be lost
DRIFT = 0.3  # s between two TIMESYNC exchanges, of a simulator that is slower than real time
NANO = 1e9  # TIMESYNC is in ns


@dataclass(slots=True)
class Way:
    """What is known about a place."""

    first_at: float  # s, when it was first heard
    heard_at: float = -inf
    answered_at: float = -inf
    #: bounds of the vehicle's clock less ours, s
    least: float = -inf
    most: float = inf
    #: whether it leads to the vehicle; None: not known yet; False: another one is there, for good
    is_same: bool | None = None

    def note_answer(self, answer: m.Timesync, *, now: float) -> None:
        """Note the answer to our TIMESYNC request."""
        self.answered_at = now
        self.least, self.most = answer.tc1 / NANO - now, (answer.tc1 - answer.ts1) / NANO

    def judge(
        self, message: m.Message, uid: str, used: "Way | None", *, is_heard: bool, used_at: float
    ) -> None:
        """Look whether a message shows that this leads to the vehicle with that unique id.

        While that is heard at the place in use, both clocks must agree. If they do not, it may also
        have restarted here, as long as nothing came from there since (``used_at``).
        """
        if not isinstance(message, m.AutopilotVersion) or not uid or self.is_same is False:
            return
        is_same: bool | None = uid_of(message) == uid
        if is_same and is_heard:
            if used is None or abs(self.answered_at - used.answered_at) > UNANSWERED:
                is_same = None  # it is asked again
            elif self.least - DRIFT > used.most or used.least > self.most + DRIFT:
                is_same = False if used_at > self.first_at else None
        self.is_same = is_same

    def is_better_than(self, used: "Way | None", used_at: float, *, now: float) -> bool:
        """Return whether to use this way; the one in use brought its last packet at ``used_at``."""
        unanswered = used is not None and self.answered_at - used.answered_at > UNANSWERED
        return unanswered or (self.heard_at > used_at + SILENT / 2 and now > used_at + SILENT)
