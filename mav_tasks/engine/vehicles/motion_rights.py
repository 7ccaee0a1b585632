"""Whether a client's motion messages may go to a vehicle now."""

from collections.abc import Hashable

from mav_tasks.engine.vehicles.parts import Parts
from mav_tasks.services.phase import Phase
from mav_tasks.tasks.lifecycle import STOP_IN_FORCE


def why_not_moved(parts: Parts, client: Hashable, *, takes_over: bool = False) -> str:
    """Return why a client's motion message may not pass, in words, or "" if it may.

    ``takes_over``: the client also asks for the mode in which clients drive.
    """
    why_not = why_no_motion(parts, takes_over=takes_over)
    if why_not:
        return why_not
    if parts.tasks.is_driving:  # also one that is paused
        return "not during a task"
    if not parts.monitor.armed:
        return "the rover is not armed"
    if not takes_over and not parts.authority.has_granted(client):
        return f"set {parts.persona.mode_name(parts.persona.control_mode)} first"
    return ""


def why_no_motion(parts: Parts, *, takes_over: bool = False) -> str:
    """Return why no client may move it now, in words, or "" if one may.

    With ``takes_over``, the client may continue from where we hand the vehicle back.
    """
    if parts.tasks.is_stopped:
        return STOP_IN_FORCE
    is_handed_over = takes_over and parts.control.phase is Phase.RELEASING
    if parts.control.is_engaged and not is_handed_over:
        return "not during a task"
    if parts.control.awaits_mode:
        return "the server is setting HOLD"
    return ""
