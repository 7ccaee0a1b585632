"""What was to arm a vehicle, and which of it counts: what holds it may have come since.

A word that arms may be late on the net, or come twice: then a vehicle shows armed whose disarming,
or whose STOP, is the newer word.
"""

from math import inf

LATE = 3.5  # s after a word, in which what had left before it may still come to the vehicle
#: s after a word, in which a heartbeat each second shows what had left before it
SHOWN_LATE = LATE + 1.5
RESENT = 1.0  # s in which an arming that is not answered is sent again
UNSHOWN = 0.3  # s after a disarming, in which a heartbeat may be from before it
BY_CLIENT = 2.0  # s after a client has asked for arming or a mode, in which that is its doing


class Armings:
    """The memory of who wanted one vehicle armed or disarmed."""

    def __init__(self) -> None:
        self._client_at = -inf  # a client's wish to arm went to it
        self._outdated_at = -inf  # what was to arm it before that counts no more
        self._may_show_until = -inf  # s, that it is armed by that
        self._was_disarmed = False  # then, or since
        self._is_to_be_disarmed = False  # by a client's word, and it does not show that yet

    def __repr__(self) -> str:
        return f"Armings(outdated at {self._outdated_at})"

    def client_arms(self, *, now: float) -> None:
        """A client's wish to arm goes to the vehicle through us."""
        self._client_at = now
        self.forget_halts()

    def are_by_client(self, *, now: float) -> bool:
        """Whether that the vehicle is armed now is a client's doing, through us."""
        return self._client_at > self._outdated_at and now - self._client_at <= BY_CLIENT

    def outdate(self, *, ours: float, armed: bool, now: float) -> None:
        """It is to be disarmed, or stopped: what was to arm it before that does not count.

        ``ours`` is when we last asked for arming ourselves.
        """
        self._outdate(max(ours, self._client_at), armed=armed, now=now)

    def outdate_ours(self, *, ours: float, armed: bool, now: float) -> None:
        """What we wanted to arm it for is over: the same, of our own arming alone."""
        if self._client_at < ours:
            self._outdate(ours, armed=armed, now=now)

    def outdate_earlier(self, *, armed: bool, until: float, now: float) -> None:
        """An earlier run has ended just after that: what it sent may show ``until`` then."""
        self._outdated_at, self._was_disarmed = now, not armed
        self._may_show_until = until

    def expect_disarmed(self, *, armed: bool) -> None:
        """A client's disarming goes to it: until it shows that, it is as good as disarmed."""
        self._is_to_be_disarmed = armed

    def shows(self, *, armed: bool) -> None:
        """Take note of what a heartbeat shows."""
        self._was_disarmed |= not armed
        self._is_to_be_disarmed &= armed

    def was_answered(self) -> None:
        """A disarming was acknowledged: the answer may be an older one's, until it shows."""
        self._was_disarmed = True

    def are_older(self, *, ours: float, now: float) -> bool:
        """Whether, where it shows armed, that is by a word from before it was to be disarmed."""
        return self._may_be_older(ours, now) and now >= self._outdated_at + UNSHOWN

    def do_not_count(self, *, ours: float, now: float) -> bool:
        """Whether that it shows armed means nothing to a task that waits."""
        return self._is_to_be_disarmed or self._may_be_older(ours, now)

    def forget_halts(self) -> None:
        """Whatever arms it from here on is meant."""
        self._may_show_until, self._is_to_be_disarmed = -inf, False

    def _outdate(self, asked_at: float, *, armed: bool, now: float) -> None:
        if now - asked_at <= LATE:
            self._outdated_at, self._was_disarmed = now, not armed
            self._may_show_until = min(asked_at + RESENT, now) + SHOWN_LATE

    def _may_be_older(self, ours: float, now: float) -> bool:
        is_outdated = self._was_disarmed and ours <= self._outdated_at
        return is_outdated and now <= self._may_show_until
