"""Who has a vehicle: ourselves, a client through us, or somebody else. What follows is decided
elsewhere; this is the memory of who did what to it.
"""

from collections.abc import Hashable
from dataclasses import dataclass
from math import inf

from mav_tasks.engine.vehicles.armings import BY_CLIENT, LATE
from mav_tasks.services.persona import Persona
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.view import ModeKind

STREAM_GAP = 0.5  # s between setpoints that are a stream: the least for OFFBOARD is 2 Hz
ANY_MODE = -1  # that a command may bring about: the vehicle's own affair which


@dataclass(frozen=True, slots=True)
class Before:
    """How things were when a heartbeat came that shows the vehicle disarmed."""

    at: float
    may_arm: bool
    paused: TaskReason  # why the queue stood


class Authority:
    """Permission to arm, whose doing the present mode is, and who else has been driving."""

    def __init__(self, persona: Persona, *, may_arm: bool) -> None:
        self._persona = persona
        self._arming_allowed = may_arm  # by setting
        self._asked_mode = -1  # by a client, through us
        self._asked_at = -inf
        self._passed_on: dict[int, float] = {}  # when each mode was last asked for by a client
        self._mode_is_ours = False
        self._granted: set[Hashable] = set()
        self._other_at = -inf  # sticks, or a second controller
        self._by_client: tuple[Hashable, float] = (None, -inf)  # the last that drove through us
        self._withheld: tuple[Hashable, float] = (None, -inf)  # the last motion message, of whom
        #: until somebody disarms or changes the mode
        self.may_arm = may_arm
        #: whether a restart of the vehicle has withdrawn the permission, and nobody has
        self.is_withdrawn_by_restart = False
        self._before: Before | None = None  # the last disarming; None: somebody has acted since

    def __repr__(self) -> str:
        return f"Authority(may_arm={self.may_arm}, mode_is_ours={self._mode_is_ours})"

    @property
    def may_arm_again(self) -> bool:
        """Whether we may arm once a person has said that all is well."""
        return self._arming_allowed

    def withdraw_arming(self) -> None:
        """Somebody else has a hand on the vehicle: arm it no more."""
        self.may_arm = self.is_withdrawn_by_restart = False
        self._before = None

    def note_disarmed(self, before: Before) -> None:
        """The vehicle shows that it is disarmed, not by us: by somebody, or by a restart."""
        self._before = before

    def take_disarmed(self, *, since: float) -> Before | None:
        """Return how things were before the vehicle was seen disarmed, if that was after ``since``.

        A restart at that time explains it, unless somebody has acted after it.
        """
        before, self._before = self._before, None
        return before if before is not None and before.at >= since else None

    def restarted(self, *, was_allowed: bool) -> None:
        """The vehicle has restarted under us: arm it only after a person's word, any person's."""
        self.is_withdrawn_by_restart = was_allowed
        self.may_arm = False

    def moved(self, *, may_arm: bool) -> None:
        """The vehicle is at another place: what may be armed there is another question."""
        self._arming_allowed = may_arm
        self.may_arm = self.may_arm and may_arm

    def restore_arming(self) -> None:
        """A person said that all is well."""
        self.may_arm = self._arming_allowed
        self.is_withdrawn_by_restart = False
        self._before = None

    def client_asks(self, mode: int, client: Hashable, *, present_mode: int, now: float) -> None:
        """A client's mode request goes to the vehicle; our own mode counts as set by us then.

        Whoever has asked last may drive: of two at once the vehicle would obey neither.
        """
        self._asked_mode, self._asked_at = mode, now
        self._passed_on[mode] = now
        if mode == self._persona.control_mode:
            self._granted = {client}
            self._mode_is_ours = self._mode_is_ours or present_mode == mode

    def mode_changed(self, mode: int, *, by_us: bool, is_late: bool, now: float) -> bool:
        """The vehicle shows another mode; gives whether it is our, or our clients', doing.

        ``is_late``: it was asked for before a halt, and is nobody's any more.
        """
        by_client = (
            mode == self._asked_mode == self._persona.control_mode
            and now - self._asked_at <= BY_CLIENT
        )
        self._asked_mode = -1
        self._mode_is_ours = (by_us or by_client) and not is_late
        return self._mode_is_ours

    def note_passed_on(self, *, now: float) -> None:
        """A client's command goes to the vehicle that may make it drive, in a mode of its own."""
        self._passed_on[ANY_MODE] = now

    def was_asked_before(self, mode: int, *, ours: float, halt: float) -> bool:
        """Whether a mode that is shown now was asked for shortly before a halt, and not since.

        Also where it was shown before the halt: the net may have a copy of the word for it.
        ``ours`` is when we last asked for our mode.
        """
        asked = self._asked_for(mode, ours=ours)
        return asked < halt <= asked + LATE

    def was_asked(self, mode: int, *, ours: float) -> bool:
        """Whether a mode was asked for at all, by a client through this server, or by us."""
        return self._asked_for(mode, ours=ours) > -inf

    def _asked_for(self, mode: int, *, ours: float) -> float:
        asked = max(self._passed_on.get(mode, -inf), self._passed_on.get(ANY_MODE, -inf))
        return max(asked, ours) if mode == self._persona.control_mode else asked

    def moves_by_older(self, *, halt: float) -> bool:
        """Whether what a client had sent before a halt may move the vehicle in any mode."""
        asked = self._passed_on.get(ANY_MODE, -inf)
        return asked < halt <= asked + LATE

    def kind_of(self, mode: int, *, armed: bool) -> ModeKind:
        """Return what the present mode means for taking control.

        A PX4 that has driven home by its failsafe disarms itself and shows our mode, or the return:
        nothing drives it, and it is put to HOLD before it is armed.
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
        """Whether any client may drive, as far as that is the client's doing."""
        return bool(self._granted)

    def has_granted(self, client: Hashable) -> bool:
        """Whether this client has asked for our mode since the last task or STOP."""
        return client in self._granted

    def note_withheld(self, client: Hashable, *, now: float) -> None:
        """A motion message of a client did not pass."""
        self._withheld = client, now

    def streams(self, client: Hashable, *, now: float) -> bool:
        """Whether a client would drive now, if it might."""
        who, at = self._withheld
        return who == client and now - at <= STREAM_GAP

    def revoke(self) -> None:
        """A task has ended, or a halt: a client that wants to drive must ask again.

        Nothing of any client passes from here on, so that no client drives any more.
        """
        self._granted.clear()
        self._by_client = (None, -inf)

    def forget(self, client: Hashable) -> bool:
        """A client is gone; gives whether it had control. Who comes to its place must ask."""
        had_control = client in self._granted
        self._granted.discard(client)
        return had_control

    def note_client(self, client: Hashable, *, now: float) -> None:
        """A client's motion message goes to the vehicle: the client is driving just now."""
        self._by_client = client, now

    def driver(self, *, within: float, now: float) -> Hashable:
        """Return the client that was driving in the last so many seconds, None if none was."""
        client, at = self._by_client
        return client if now - at < within else None

    def note_other(self, *, now: float) -> None:
        """Somebody who is no client of ours is driving just now."""
        self._other_at = now

    def since_other(self, *, now: float) -> float:
        """Return the seconds since somebody else was driving, clients included."""
        return now - max(self._other_at, self._by_client[1])
