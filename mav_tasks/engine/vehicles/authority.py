"""Who has a vehicle: we, a client through us, or somebody else; and who asked to arm it.

This module only remembers who did what to the vehicle; other modules decide what follows. A request
to arm may be late, or arrive twice: then a vehicle shows armed although the request to disarm or
stop it is newer.
"""

from collections.abc import Hashable
from dataclasses import dataclass
from math import inf

from mav_tasks.basics.latest import keep_latest
from mav_tasks.engine.services.persona import Persona
from mav_tasks.tasks.halts import Halts, Permit
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.view import ModeKind

LATE = 3.5  # s after a request, in which packets sent before it may still reach the vehicle
#: s after a request, in which a 1 Hz heartbeat shows the effect of such packets
SHOWN_LATE = LATE + 1.5
RESENT = 1.0  # s in which an unanswered arming is sent again
UNSHOWN = 0.3  # s after a disarming, in which a heartbeat may still be from before it
BY_CLIENT = 2.0  # s in which a mode counts as the result of a client's request


class Armings:
    """The memory of who wanted one vehicle armed or disarmed."""

    def __init__(self) -> None:
        self.client_at = -inf  #: when a client last asked to arm it, and was not refused
        self._outdated_at = -inf  # requests to arm from before this time do not count
        self._may_show_until = -inf  # s, that such a request shows as armed
        self.was_disarmed = False  #: at that time, or since
        #: a client asked for its disarming, and no heartbeat has shown that yet: until then the
        #: vehicle counts as disarmed
        self.is_to_be_disarmed = False
        self._is_armed = self._is_clients = False  # as shown; by a client through us

    def __repr__(self) -> str:
        return f"Armings(outdated at {self._outdated_at})"

    def client_arms(self, *, now: float) -> None:
        """Note that a client's request to arm goes to the vehicle through us."""
        self.client_at = now
        self.forget_halts()

    def are_by_client(self, *, now: float) -> bool:
        """Return whether a client, through us, has armed the vehicle, or has just asked for it."""
        is_soon = now - self.client_at <= SHOWN_LATE
        may_be = is_soon and self.client_at > self._outdated_at
        return self._is_clients if self._is_armed else may_be

    def outdate(self, *, ours: float, armed: bool, now: float, only_ours: bool = False) -> None:
        """Outdate earlier requests to arm, because the vehicle is to be disarmed or stopped.

        ``ours`` is when we last asked for arming ourselves. ``only_ours``: only that one, if it is
        the latest, because we need it armed no more.
        """
        asked_at = max(ours, self.client_at)
        is_meant = not only_ours or self.client_at < ours
        if is_meant and now - asked_at <= LATE:
            self._outdated_at, self.was_disarmed = now, not armed
            self._may_show_until = min(asked_at + RESENT, now) + SHOWN_LATE

    def outdate_earlier(self, *, armed: bool, until: float, now: float) -> None:
        """Outdate the requests of an earlier run; their effect may show ``until`` then."""
        self._outdated_at, self.was_disarmed = now, not armed
        self._may_show_until = until

    def shows(self, *, armed: bool, now: float) -> None:
        """Note the armed state in a heartbeat, and who armed it if it is the first to show it."""
        self._is_clients = self.are_by_client(now=now)
        self._is_armed = armed
        self.was_disarmed |= not armed
        self.is_to_be_disarmed &= armed

    def are_older(self, *, ours: float, now: float) -> bool:
        """Return whether, if it shows armed, that is by an outdated request."""
        return self._may_be_older(ours, now) and now >= self._outdated_at + UNSHOWN

    def do_not_count(self, *, ours: float, now: float) -> bool:
        """Return whether a task must ignore that the vehicle shows armed."""
        return self.is_to_be_disarmed or self._may_be_older(ours, now)

    def forget_halts(self) -> None:
        """Forget the halts: any arming from here on counts."""
        self._may_show_until, self.is_to_be_disarmed = -inf, False

    def _may_be_older(self, ours: float, now: float) -> bool:
        return self.was_disarmed and ours <= self._outdated_at and now <= self._may_show_until


STREAM_GAP = 0.5  # s between the setpoints of a stream: OFFBOARD needs at least 2 Hz
MOST_MODES = 64  # remembered: a client can make up any number
ANY_MODE = -1  # key for commands by which the vehicle may choose any mode


@dataclass(frozen=True, slots=True)
class Before:
    """The state when a heartbeat came that shows the vehicle disarmed."""

    at: float
    may_arm: bool
    paused: TaskReason  # why the queue was paused


@dataclass(slots=True)
class Driving:
    """A client's permission to drive through us, and what it has done with it."""

    client: Hashable = None  # that has the grant; only the last one that asked may drive
    mode: int = -1  # that a client last asked for through us
    driver: Hashable = None  # the last one that drove through us
    drove_at: float = -inf


class Authority:
    """The permission to arm, who set the present mode, and who else has been driving."""

    def __init__(self, persona: Persona, halts: Halts, *, may_arm: bool) -> None:
        self._persona = persona
        #: by the settings: whether we may arm it once a person allows that again
        self.may_arm_again = may_arm
        self._permit = Permit[Driving](halts)
        self._asked_at = -inf
        #: when a client last asked for each mode, or (ANY_MODE) for what may set one
        self.passed_on: dict[int, float] = {}
        self._mode_is_ours = False
        self.other_at = -inf  #: s, when somebody drove it who is not our client
        #: the client whose motion message did not pass last, and when
        self.withheld: tuple[Hashable, float] = (None, -inf)
        #: whether we may arm it; withdrawn when somebody disarms it or changes its mode
        self.may_arm = may_arm
        #: whether a vehicle restart, and nobody, has withdrawn the permission
        self.is_withdrawn_by_restart = False
        #: at the last disarming that was not ours; None: somebody has acted since
        self.before: Before | None = None

    def __repr__(self) -> str:
        return f"Authority(may_arm={self.may_arm}, mode_is_ours={self._mode_is_ours})"

    @property
    def _driving(self) -> Driving:
        driving = self._permit.holder()
        if driving is None:
            driving = Driving()
            self._permit.give(driving)
        return driving

    def withdraw_arming(self) -> None:
        """Stop arming the vehicle, because somebody else controls it."""
        self.may_arm = self.is_withdrawn_by_restart = False
        self.before = None

    def restarted(self, *, was_allowed: bool) -> None:
        """Withdraw the permission to arm after a vehicle restart; any person may restore it."""
        self.is_withdrawn_by_restart |= was_allowed
        self.may_arm = False

    def moved(self, *, may_arm: bool) -> None:
        """Apply the permission to arm of the link on which the vehicle is now."""
        self.may_arm_again = may_arm
        self.may_arm = self.may_arm and may_arm

    def restore_arming(self) -> None:
        """Allow arming again, as a person asked."""
        self.may_arm = self.may_arm_again
        self.is_withdrawn_by_restart = False
        self.before = None

    def client_asks(self, mode: int, client: Hashable, *, present_mode: int, now: float) -> None:
        """Note a client's mode request to the vehicle; our own mode then counts as set by us.

        Only the last client that asked may drive: the vehicle would obey neither of two at once.
        """
        self._driving.mode, self._asked_at = mode, now
        keep_latest(self.passed_on, mode, now, most=MOST_MODES)
        if mode == self._persona.control_mode:
            self._driving.client = client
            self._mode_is_ours = self._mode_is_ours or present_mode == mode

    def mode_changed(self, mode: int, *, by_us: bool, is_late: bool, now: float) -> bool:
        """Note that the vehicle shows another mode. Return whether we or a client set it.

        ``is_late``: it was asked for before a halt, so it counts as set by nobody.
        """
        driving = self._driving
        by_client = (
            mode == driving.mode == self._persona.control_mode and now - self._asked_at <= BY_CLIENT
        )
        if mode == driving.mode or not by_us:  # a HOLD of ours may show before it does
            driving.mode = -1
        self._mode_is_ours = (by_us or by_client) and not is_late
        return self._mode_is_ours

    def was_asked_before(self, mode: int, *, ours: float = -inf, halt: float) -> bool:
        """Return whether a mode shown now was asked for shortly before a halt, and not since.

        Also if it was shown before the halt: the network may hold a copy of the request. ``ours``
        is when we last asked for our mode. ANY_MODE: what may move the vehicle in any mode.
        """
        asked = self._asked_for(mode, ours=ours)
        return asked < halt <= asked + LATE

    def was_asked(self, mode: int, *, ours: float) -> bool:
        """Return whether a client through us, or we, ever asked for a mode."""
        return self._asked_for(mode, ours=ours) > -inf

    def _asked_for(self, mode: int, *, ours: float) -> float:
        asked = max(self.passed_on.get(mode, -inf), self.passed_on.get(ANY_MODE, -inf))
        return max(asked, ours) if mode == self._persona.control_mode else asked

    def kind_of(self, mode: int, *, armed: bool) -> ModeKind:
        """Return what the present mode means for taking control.

        A PX4 that has driven home by its failsafe disarms itself and shows our mode, or the return
        mode. Nothing drives it, and it is put in HOLD before it is armed.
        """
        at_rest = (self._persona.control_mode, self._persona.return_mode)
        is_home = self._persona.arms_in_hold and not armed and mode in at_rest
        if mode == self._persona.hold_mode or (is_home and not self._mode_is_ours):
            return ModeKind.HOLD
        if mode == self._persona.control_mode and self._mode_is_ours:
            return ModeKind.OURS
        return ModeKind.MANUAL if mode in self._persona.manual_modes else ModeKind.OTHER

    @property
    def has_any_grant(self) -> bool:
        """Whether any client has a grant to drive."""
        return self._driving.client is not None

    def has_granted(self, client: Hashable) -> bool:
        """Return whether this client has asked for our mode since the last task or halt."""
        return client is not None and client == self._driving.client

    def streams(self, client: Hashable, *, now: float) -> bool:
        """Return whether a client streams motion messages that do not pass."""
        who, at = self.withheld
        return who == client and now - at <= STREAM_GAP

    def revoke(self) -> None:
        """Revoke the grant, as a halt does: a client that wants to drive must ask again.

        No client's motion messages pass from here on, so no client drives any more.
        """
        self._permit.end()

    def forget(self, client: Hashable) -> bool:
        """Forget a client that is gone. Return whether it had a grant. A successor must ask."""
        had_control = self.has_granted(client)
        if had_control:
            self._driving.client = None
        return had_control

    def note_client(self, client: Hashable, *, now: float) -> None:
        """Note that a client's motion message goes to the vehicle: it is driving."""
        self._driving.driver, self._driving.drove_at = client, now

    def driver(self, *, within: float, now: float) -> Hashable:
        """Return the client that was driving in the last ``within`` seconds, or None."""
        driving = self._driving
        return driving.driver if now - driving.drove_at < within else None

    def since_other(self, *, now: float) -> float:
        """Return the seconds since somebody else, or a client, was driving."""
        return now - max(self.other_at, self._driving.drove_at)
