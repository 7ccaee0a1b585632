"""What a vehicle's heartbeats show, and what they prove of what was asked of it.

At 1 Hz the last known mode is up to a second old, and a heartbeat may have left before a request
was heard. So a request of ours makes what is known unsettled, until a heartbeat comes that must
have been sent after it; what one shows in the meantime may be our own doing, or a person's.
"""

from math import inf

from mav_tasks.engine.services.persona import Persona

#: s after a request was last sent in which what it asks for may still come true: a copy of it may
#: be late on the net. Longer, and a person who does the same would be taken for it.
LATE = 0.3
#: s after an accepted request in which a heartbeat may still show what was before: PX4 answers, and
#: composes the heartbeat that it is asked for, before its mode has changed (1.17, SITL)
SHOWN_LATE = 0.3
UNANSWERED = 0.3  # s after which a request without an answer was heard, or lost
AWAITED = 1.5  # s, the longest until a 1 Hz heartbeat shows what a disarming has done
SHOWN_LATELY = 2.5  # s since a heartbeat has shown it, of which one may be lost
UNSHOWN = -1  # no mode of any vehicle


class News:
    """What one vehicle has shown, beside what we have asked of it."""

    def __init__(self, persona: Persona) -> None:
        self._persona = persona
        self.armed = False  #: as shown last
        self.mode = UNSHOWN  #: as shown last
        self.shown_at = -inf  #: s, when a heartbeat has shown them
        self._since = -inf  # s, what was read before may have been old
        #: whether a heartbeat shows what became of the last mode or disarm request of ours
        self.is_settled = True
        self._asked_mode: int | None = persona.hold_mode  # by the last request; None: disarming
        self._settles_at = -inf  # a heartbeat from then on was sent after the request was heard
        #: HOLD was shown when it was asked for: only the answer tells it from that of a failsafe
        self.awaits_answer = False
        #: the latest heartbeat was the first to show what was asked for
        self.was_awaited = False
        #: s, when each was last asked for: HOLD, disarming, our mode, arming
        self.hold_asked_at = self.disarming_asked_at = -inf
        self.mode_asked_at = self.arming_asked_at = -inf

    def __repr__(self) -> str:
        return f"News(mode={self.mode}, armed={self.armed}, is_settled={self.is_settled})"

    @property
    def in_our_mode(self) -> bool:
        """Whether it shows the mode in which it follows set-points, and that is no old news."""
        return self.is_settled and self.mode == self._persona.control_mode

    @property
    def in_hold(self) -> bool:
        """Whether it shows HOLD, and that is no old news."""
        return self.is_settled and self.mode == self._persona.hold_mode

    def adopt(self, persona: Persona) -> None:
        """Read it as another of the same make from now on."""
        self._persona = persona

    def heard(self, *, armed: bool, mode: int, now: float) -> None:
        """Take in a heartbeat; one that may have left before our last request proves nothing."""
        self.was_awaited = not self.is_settled
        is_old_news = self.awaits_answer and mode == self._persona.hold_mode
        shows_it = not armed if self._asked_mode is None else mode == self._asked_mode
        if now >= self._settles_at + (0.0 if shows_it else SHOWN_LATE) and not is_old_news:
            self.is_settled = True
        self.armed, self.mode, self.shown_at = armed, mode, now

    def outdated(self, *, until: float) -> None:
        """What is read until then has lain unread, and shows what was before."""
        self._since = until

    def restarted(self) -> None:
        """The vehicle has restarted: what it showed before proves nothing any more."""
        self.armed, self.mode = False, UNSHOWN

    def accepted(self, *, is_mode: bool, now: float) -> None:
        """The vehicle has accepted our last request."""
        self._settles_at = min(self._settles_at, now)
        if self.awaits_answer and is_mode:
            self.awaits_answer = False
            self.is_settled = True  # shown before, and heard that it is meant

    def unsettle(self, now: float, *, mode: int | None = None, awaits_hold: bool = False) -> None:
        """What the next heartbeats say may be from before the request that leaves now.

        ``mode`` is what is asked for; None: disarming.
        """
        self._asked_mode = self._persona.hold_mode if awaits_hold else mode
        is_shown = self.mode == self._persona.hold_mode
        self.awaits_answer = awaits_hold and is_shown and self._persona.has_loss_failsafe
        self.is_settled = False
        self._settles_at = now + UNANSWERED

    def is_newer_than(self, moment: float) -> bool:
        """Whether a heartbeat has come since, and had not lain unread."""
        return self.shown_at >= max(moment, self._since)

    def is_silent(self, now: float) -> bool:
        """Whether no heartbeat has shown its mode lately."""
        return now - self.shown_at > SHOWN_LATELY

    def may_be_our_mode(self, mode: int, *, now: float) -> bool:
        """Whether a change to this mode can be our own doing."""
        if mode not in (self._persona.hold_mode, self._persona.control_mode):
            return False
        asked_at = self.hold_asked_at if mode == self._persona.hold_mode else self.mode_asked_at
        is_awaited = self.was_awaited and mode == self._asked_mode
        return now - asked_at <= LATE or (is_awaited and asked_at > -inf)

    def may_be_our_disarming(self, *, is_stopping: bool, now: float) -> bool:
        """Whether a disarming just seen can be our own doing."""
        since = now - self.disarming_asked_at
        is_awaited = self.was_awaited or is_stopping
        return since <= LATE or (is_awaited and since <= AWAITED)
