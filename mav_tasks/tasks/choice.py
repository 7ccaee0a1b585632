"""Chooses the rover for a task that any rover may drive. Pure.

A candidate is what is known of one rover, for one task. The choice is the rover that would begin
the task first: when its queue is empty, plus the way from there to the task's start. A rover that
cannot begin it as it stands (silent, stopped, paused, low on battery, unable) is no candidate; if
there is none, the refusal says of each rover why. Ties go to the shorter queue, the nearer rover,
then the lower system id, so that equal worlds choose equally.
"""

from collections.abc import Sequence
from math import inf, isnan
from typing import NamedTuple

from mav_tasks.errors import Rejection
from mav_tasks.tasks.lifecycle import TaskReason, words_of

R = TaskReason

AT_ONCE = 1.0  # s; a rover that is free so soon is called free
HERE = 0.5  # m; a start so near is not worth a word
MOST_NAMED = 8  # other rovers named in one text


class Candidate(NamedTuple):
    """One rover as it stands, and what the task would cost it. SI units.

    ``blocker``: why no task could take control of it now, or NONE. ``inability``: why it cannot
    drive this task, "" if it can. ``battery``: 0 to 1; None: not known, which counts as good.
    ``free_in``: s until its queue is empty, and ``distance``: m from where it is then to the task's
    start, 0 if the task begins there; NaN: not known. ``waiting``: the length of its queue.
    """

    vehicle: int
    is_heard: bool = True
    paused: TaskReason = R.NONE
    is_held_ahead: bool = False
    is_driven_by_client: bool = False
    blocker: TaskReason = R.NONE
    is_full: bool = False
    inability: str = ""
    battery: float | None = None
    free_in: float = 0.0
    distance: float = 0.0
    speed: float = 1.0
    waiting: int = 0

    @property
    def begins_in(self) -> float:
        """Seconds until it could begin the task; inf if that is not known."""
        seconds = self.free_in + self.distance / self.speed
        return inf if isnan(seconds) else seconds


class Choice(NamedTuple):
    """The chosen rover, and why, in words."""

    vehicle: int
    words: str


def choose(candidates: Sequence[Candidate], *, least_battery: float) -> Choice:
    """Return the rover that would begin the task first; ``least_battery``: 0 to 1.

    Raise Rejection, which names why each rover cannot, if none can.
    """
    against = {each.vehicle: why_not(each, least_battery=least_battery) for each in candidates}
    able = [each for each in candidates if against[each.vehicle] is None]
    if not able:
        raise _refusal([each for each in against.values() if each is not None])
    best = min(able, key=_order)
    others = [
        f"rover {each.vehicle}: begins in {_seconds(each.begins_in)}"
        for each in sorted(able, key=_order)
        if each is not best
    ]
    others += [each.text for each in against.values() if each is not None]
    named = others[:MOST_NAMED] + (["and others"] if len(others) > MOST_NAMED else [])
    words = _praise(best)
    return Choice(best.vehicle, f"{words} ({'; '.join(named)})" if named else words)


def why_not(candidate: Candidate, *, least_battery: float) -> Rejection | None:
    """Return why a rover cannot be chosen, or None if it can."""
    reason, words = _obstacle(candidate, least_battery)
    return Rejection(reason, f"rover {candidate.vehicle}: {words}") if words else None


def is_low(battery: float | None, *, least_battery: float) -> bool:
    """Return whether a charge is below the bound; one that is not known counts as good."""
    return battery is not None and battery < least_battery


def _obstacle(it: Candidate, least_battery: float) -> tuple[TaskReason, str]:
    """Return the first obstacle, with its words; "" if there is none."""
    if it.inability:
        return R.NOT_SUPPORTED_BY_VEHICLE, it.inability
    if not it.is_heard:
        return R.VEHICLE_SILENT, "silent"
    if it.paused is R.STOPPED:
        return R.STOPPED, "STOP in force"
    if it.paused:
        return R.QUEUE_PAUSED, f"queue paused ({words_of(it.paused)})"
    if it.is_held_ahead:
        return R.HELD_AHEAD, "a task is held"
    if it.is_driven_by_client:
        return R.OTHER_CONTROLLER, "a client drives it"
    if is_low(it.battery, least_battery=least_battery):
        assert it.battery is not None
        return R.NOT_READY, f"battery {it.battery:.0%}, less than {least_battery:.0%}"
    if it.blocker:
        return it.blocker, words_of(it.blocker)
    if it.is_full:
        return R.QUEUE_FULL, "queue full"
    return R.NONE, ""


def _order(it: Candidate) -> tuple[float, int, float, int]:
    far = inf if isnan(it.distance) else it.distance
    return it.begins_in, it.waiting, far, it.vehicle


def _refusal(against: Sequence[Rejection]) -> Rejection:
    """Return the refusal of all rovers; its reason is one that may pass, if there is one."""
    if not against:
        return Rejection(R.VEHICLE_SILENT, "no rover is heard")
    passing = [each for each in against if each.reason != R.NOT_SUPPORTED_BY_VEHICLE]
    reason = (passing or against)[0].reason
    return Rejection(reason, f"no rover can: {'; '.join(each.text for each in against)}")


def _praise(it: Candidate) -> str:
    """Return what speaks for the chosen rover."""
    words = "free" if it.free_in < AT_ONCE else f"free in {_seconds(it.free_in)}"
    if it.distance > HERE:
        words += f", {it.distance:.0f} m away"
    return words if it.battery is None else f"{words}, battery {it.battery:.0%}"


def _seconds(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < inf else "an unknown time"
