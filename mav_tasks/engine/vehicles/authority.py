"""Who has a vehicle: we, a client through us, or somebody else.

This module only remembers who did what to the vehicle; other modules decide what follows.
"""

from collections.abc import Hashable
from dataclasses import dataclass
from math import inf

from mav_tasks.engine.vehicles.armings import BY_CLIENT, LATE
from mav_tasks.latest import keep_latest
from mav_tasks.services.persona import Persona
from mav_tasks.tasks.halts import Halts
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.permit import Permit
from mav_tasks.tasks.view import ModeKind

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
        self._passed_on: dict[int, float] = {}  # when a client last asked for each mode
        self._mode_is_ours = False
        self.other_at = -inf  #: s, when somebody drove it who is not our client
        self._withheld: tuple[Hashable, float] = (None, -inf)  # the last motion message's sender
        #: whether we may arm it; withdrawn when somebody disarms it or changes its mode
        self.may_arm = may_arm
        #: whether a vehicle restart, and nobody, has withdrawn the permission
        self.is_withdrawn_by_restart = False
        self._before: Before | None = None  # at the last disarming; None: somebody has acted since

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
        self._before = None

    def note_disarmed(self, before: Before) -> None:
        """Remember the state before a disarming that was not ours."""
        self._before = before

    def take_disarmed(self, *, since: float) -> Before | None:
        """Return the state before the disarming, if that was seen after ``since``, else None.

        A restart at that time explains the disarming, unless somebody has acted after it.
        """
        before, self._before = self._before, None
        return before if before is not None and before.at >= since else None

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
        self._before = None

    def client_asks(self, mode: int, client: Hashable, *, present_mode: int, now: float) -> None:
        """Note a client's mode request to the vehicle; our own mode then counts as set by us.

        Only the last client that asked may drive: the vehicle would obey neither of two at once.
        """
        self._driving.mode, self._asked_at = mode, now
        keep_latest(self._passed_on, mode, now, most=MOST_MODES)
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

    def note_passed_on(self, *, now: float) -> None:
        """Note a client's command to the vehicle that may make it drive, in a mode of its own."""
        self._passed_on[ANY_MODE] = now

    def was_asked_before(self, mode: int, *, ours: float, halt: float) -> bool:
        """Return whether a mode shown now was asked for shortly before a halt, and not since.

        Also if it was shown before the halt: the network may hold a copy of the request. ``ours``
        is when we last asked for our mode.
        """
        asked = self._asked_for(mode, ours=ours)
        return asked < halt <= asked + LATE

    def was_asked(self, mode: int, *, ours: float) -> bool:
        """Return whether a client through us, or we, ever asked for a mode."""
        return self._asked_for(mode, ours=ours) > -inf

    def _asked_for(self, mode: int, *, ours: float) -> float:
        asked = max(self._passed_on.get(mode, -inf), self._passed_on.get(ANY_MODE, -inf))
        return max(asked, ours) if mode == self._persona.control_mode else asked

    def moves_by_older(self, *, halt: float) -> bool:
        """Return whether a client's command from before a halt may move the vehicle in any mode."""
        asked = self._passed_on.get(ANY_MODE, -inf)
        return asked < halt <= asked + LATE

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

    def note_withheld(self, client: Hashable, *, now: float) -> None:
        """Note that a client's motion message did not pass."""
        self._withheld = client, now

    def streams(self, client: Hashable, *, now: float) -> bool:
        """Return whether a client streams motion messages that do not pass."""
        who, at = self._withheld
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
