"""Who asked to arm a vehicle, and which requests still count: a halt may have come since.

A request to arm may be late, or arrive twice. Then a vehicle shows armed although the request to
disarm or stop it is newer.
"""

from math import inf

LATE = 3.5  # s after a request, in which packets sent before it may still reach the vehicle
#: s after a request, in which a 1 Hz heartbeat shows the effect of such packets
SHOWN_LATE = LATE + 1.5
RESENT = 1.0  # s in which an unanswered arming is sent again
UNSHOWN = 0.3  # s after a disarming, in which a heartbeat may still be from before it
BY_CLIENT = 2.0  # s in which a mode counts as the result of a client's request


class Armings:
    """The memory of who wanted one vehicle armed or disarmed."""

    def __init__(self) -> None:
        self._client_at = -inf  # when a client last asked to arm it
        self._outdated_at = -inf  # requests to arm from before this time do not count
        self._may_show_until = -inf  # s, that such a request shows as armed
        self._was_disarmed = False  # at that time, or since
        #: a client asked for its disarming, and no heartbeat has shown that yet: until then the
        #: vehicle counts as disarmed
        self.is_to_be_disarmed = False
        self._is_armed = self._is_clients = False  # as shown; by a client through us

    def __repr__(self) -> str:
        return f"Armings(outdated at {self._outdated_at})"

    def client_arms(self, *, now: float) -> None:
        """Note that a client's request to arm goes to the vehicle through us."""
        self._client_at = now
        self.forget_halts()

    def client_was_refused(self) -> None:
        """Note that the vehicle has refused it: if it shows armed now, somebody else did it."""
        self._client_at = -inf

    def are_by_client(self, *, now: float) -> bool:
        """Return whether a client, through us, has armed the vehicle, or has just asked for it."""
        is_soon = now - self._client_at <= SHOWN_LATE
        may_be = is_soon and self._client_at > self._outdated_at
        return self._is_clients if self._is_armed else may_be

    def outdate(self, *, ours: float, armed: bool, now: float) -> None:
        """Outdate earlier requests to arm, because the vehicle is to be disarmed or stopped.

        ``ours`` is when we last asked for arming ourselves.
        """
        self._outdate(max(ours, self._client_at), armed=armed, now=now)

    def outdate_ours(self, *, ours: float, armed: bool, now: float) -> None:
        """Outdate our own request to arm, if it is the latest: we need it armed no more."""
        if self._client_at < ours:
            self._outdate(ours, armed=armed, now=now)

    def outdate_earlier(self, *, armed: bool, until: float, now: float) -> None:
        """Outdate the requests of an earlier run; their effect may show ``until`` then."""
        self._outdated_at, self._was_disarmed = now, not armed
        self._may_show_until = until

    def shows(self, *, armed: bool, now: float) -> None:
        """Note the armed state in a heartbeat, and who armed it if it is the first to show it."""
        self._is_clients = self.are_by_client(now=now)
        self._is_armed = armed
        self._was_disarmed |= not armed
        self.is_to_be_disarmed &= armed

    def was_answered(self) -> None:
        """Note an acknowledged disarming; the acknowledgement may belong to an older one."""
        self._was_disarmed = True

    def are_older(self, *, ours: float, now: float) -> bool:
        """Return whether, if it shows armed, that is by an outdated request."""
        return self._may_be_older(ours, now) and now >= self._outdated_at + UNSHOWN

    def do_not_count(self, *, ours: float, now: float) -> bool:
        """Return whether a task must ignore that the vehicle shows armed."""
        return self.is_to_be_disarmed or self._may_be_older(ours, now)

    def forget_halts(self) -> None:
        """Forget the halts: any arming from here on counts."""
        self._may_show_until, self.is_to_be_disarmed = -inf, False

    def _outdate(self, asked_at: float, *, armed: bool, now: float) -> None:
        if now - asked_at <= LATE:
            self._outdated_at, self._was_disarmed = now, not armed
            self._may_show_until = min(asked_at + RESENT, now) + SHOWN_LATE

    def _may_be_older(self, ours: float, now: float) -> bool:
        return self._was_disarmed and ours <= self._outdated_at and now <= self._may_show_until
