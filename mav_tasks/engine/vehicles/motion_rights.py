"""Whether a client's motion messages may go to a vehicle, and what they mean for its tasks."""

from collections.abc import Hashable

from mav_tasks.engine.vehicles.parts import Parts
from mav_tasks.services.phase import Phase
from mav_tasks.tasks.lifecycle import STOP_IN_FORCE


class MotionRights:
    """Decides which client, if any, may move one vehicle."""

    def __init__(self, parts: Parts) -> None:
        self._parts = parts

    def __repr__(self) -> str:
        return f"MotionRights({self._parts.authority!r})"

    def why_not_moved(self, client: Hashable, *, takes_over: bool = False) -> str:
        """Return why a client's motion message may not pass, in words, or "" if it may.

        ``takes_over``: the client also asks for the mode in which clients drive.
        """
        parts = self._parts
        why_not = self.why_no_motion(takes_over=takes_over)
        if why_not:
            return why_not
        if parts.tasks.is_driving:  # also one that is paused
            return "not during a task"
        if not parts.monitor.armed:
            return "the rover is not armed"
        if not takes_over and not parts.authority.has_granted(client):
            return f"set {parts.persona.mode_name(parts.persona.control_mode)} first"
        return ""

    def why_no_motion(self, *, takes_over: bool = False) -> str:
        """Return why no client may move it now, in words, or "" if one may.

        With ``takes_over``, the client may continue from where we hand the vehicle back.
        """
        parts = self._parts
        if parts.tasks.is_stopped:
            return STOP_IN_FORCE
        is_handed_over = takes_over and parts.control.phase is Phase.RELEASING
        if parts.control.is_engaged and not is_handed_over:
            return "not during a task"
        if parts.control.awaits_mode:
            return "the server is setting HOLD"
        return ""

    def withheld(self, client: Hashable, *, now: float) -> None:
        """Note that a client's motion message does not go to the vehicle."""
        self._parts.authority.note_withheld(client, now=now)

    def passed(self, client: Hashable, *, now: float) -> None:
        """Note that a client's motion message goes to the vehicle, so that tasks wait."""
        self._parts.authority.note_client(client, now=now)

    def has_granted(self, client: Hashable) -> bool:
        """Return whether a client has the grant to drive."""
        return self._parts.authority.has_granted(client)

    def is_armed_by_client(self, *, now: float) -> bool:
        """Return whether a client has asked for arming, through us, just now."""
        return self._parts.armings.are_by_client(now=now)
