"""Row: thirty tasks, one after another, each measured where the rover then stands."""

from cmath import rect
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import ceil, degrees, radians, remainder, tau

from mav_tasks.client.wire import Goal
from mav_tasks.kinds import GoTo, LocalPlace, Move, Rotate
from rover_sim.observing.track import Place
from rover_sim.trial.session import End, Result, Session

WITHIN = 300.0  # s for one task, at 0.5 m/s: 45 m to a mission of 30 m, and curves
MOST_SHOWN = 4  # failures shown
UNABLE = ("not turn", "not reverse", "cannot turn")  # in refusals of impossible tasks
#: m north, and m east as the imaginary part: a rotation is a product, and abs() a distance
Vector = complex


@dataclass(frozen=True, slots=True)
class TrialTask:
    """One task: words, goals, and the expected end in reported coordinates."""

    words: str
    goals: tuple[Goal, ...]
    end: Vector | None = None  # None: a turn, or unknown
    turn: float | None = None  # rad
    is_relative: bool = False  # to the rover's place at its start, as for a move


#: further ones replace those that the rover cannot drive. m and degrees; places are ahead and to
#: the right of where the trial began, or of where it is now (near); the mission bends as a car can
TASKS = (
    "move 0.3, move 0.5, turn 90, move 1, turn -90, move 2, move -1, turn 45, move 0.3, turn -45, "
    "move 3, turn 180, move 3, turn 120, turn 60, near 3 0, go 30 0, go 20 8, move 0.5, turn -120, "
    "move -1, go 0 0, move 10, turn 30, move 1, move 5, "
    "mission 10 0 14.2 4.2 14.2 10.2 10 14.5 4 14.5, move 0.3, move 2, return"
)
FURTHER = (
    "near 3 0, move 0.3, move 0.5, move 1, go 10 4, move 2, near 3 0, move 0.3, go 18 -4, move 1, "
    "move 0.5, move 0.3, go 2 0"
)


def task_of(words: str, now: Place, begun: Place) -> TrialTask:
    """Return a task from the reported place now and that at the start of the trial."""
    kind, *numbers = words.split()
    values = [float(number) for number in numbers]
    match kind:
        case "move":
            goal = Move(values[0])
            return TrialTask(words, (goal,), _offset(now, values[0], 0.0), is_relative=True)
        case "turn":
            angle = radians(values[0])
            return TrialTask(words, (Rotate(angle),), turn=angle)
        case "return":  # to a place that the trial does not know
            return TrialTask(words, (GoTo(None),))
    base = now if kind == "near" else begun
    pairs = zip(values[::2], values[1::2], strict=True)
    places = [_offset(base, forward, right) for forward, right in pairs]
    goals = tuple(GoTo(LocalPlace(place.real, place.imag)) for place in places)
    return TrialTask(words, goals, places[-1])


def _at(place: Place) -> Vector:
    return complex(place.north, place.east)


def _offset(place: Place, forward: float, right: float) -> Vector:
    return _at(place) + complex(forward, right) * rect(1.0, place.yaw)


@dataclass(slots=True)
class Tally:
    """Results of the tasks so far."""

    ends: list[tuple[TrialTask, End]] = field(default_factory=list)
    refused: int = 0
    #: of each completed task with a place, the error of the true end, m, and the shift in it (None:
    #: the mean one). A move should end at its distance from its true start, along the reported
    #: heading; a place is in the rover's frame, which is shifted against the true one
    driven: list[tuple[Vector, Vector | None]] = field(default_factory=list)
    believed: list[float] = field(default_factory=list)  # cm, by the estimate: the server's part
    angles: list[float] = field(default_factory=list)  # degrees, errors of turns
    shifts: list[Vector] = field(default_factory=list)  # of the true frame, each measured at rest

    def off(self) -> list[float]:
        """Return the errors of the true ends, cm; the mean shift has less of the estimate's."""
        mean = sum(self.shifts) / len(self.shifts)
        return [
            abs(error - (mean if shift is None else shift)) * 100 for error, shift in self.driven
        ]


async def drive_tasks(session: Session) -> Result:
    """Drive the thirty tasks."""
    tally = Tally()
    true = await session.rest()
    begun = session.told.last
    tally.shifts.append(_at(true) - _at(begun))
    left, instead = TASKS.split(", "), FURTHER.split(", ")
    while left:
        await _drive_one(session, left.pop(0), begun, tally)
        if len(left) == 1:  # before the way home
            left[:0], instead = instead[: tally.refused], []
    return _result(session, tally)


async def _drive_one(session: Session, words: str, begun: Place, tally: Tally) -> None:
    before, told = session.track.last, session.told.last
    asked = task_of(words, told, begun)
    end = await session.drive(asked.goals, within=WITHIN)
    if end.state == "REFUSED" and any(word in end.words for word in UNABLE):
        session.say(f"  {asked.words}: refused: {end.words}")
        tally.refused += 1
        return
    after = await session.rest()
    tally.ends.append((asked, end))
    told_after = session.told.last
    tally.shifts.append(_at(after) - _at(told_after))
    shown = f"  {asked.words}: {end}, {end.seconds:.1f} s"
    if not end.is_completed:
        session.say(shown)
        await session.clean()
        return
    if asked.turn is not None:
        wrong = remainder(after.yaw - before.yaw - asked.turn, tau)
        tally.angles.append(degrees(abs(wrong)))
        shown += f", {tally.angles[-1]:.2f} deg off"
    elif asked.end is not None:
        own = _at(before) - _at(told) if asked.is_relative else None
        tally.driven.append((_at(after) - asked.end, own))
        tally.believed.append(abs(_at(told_after) - asked.end) * 100)
        shown += f", {tally.off()[-1]:.1f} cm off, {tally.believed[-1]:.1f} by its estimate"
    session.say(shown)


def _result(session: Session, tally: Tally) -> Result:
    limits = session.limits
    states = Counter(end.state for _, end in tally.ends)
    words = ", ".join(f"{count} {state}" for state, count in sorted(states.items()))
    words += f"; {tally.refused} refused" if tally.refused else ""
    off, angles = tally.off(), tally.angles
    figure = f"end p50/p95/max {_three(off)} cm, by its estimate {_three(tally.believed)}"
    limit = f"p95 {limits.end * 100:g} cm"
    if angles:
        figure += f", turns {_three(angles)} deg"
        limit += f", {limits.turn:g} deg"
    wrong = [f"{asked.words}: {end}" for asked, end in tally.ends if not end.is_completed]
    holds = bool(tally.ends) and not wrong
    holds = holds and quantile(off, 0.95) <= limits.end * 100
    holds = holds and quantile(angles, 0.95) <= limits.turn
    words += f" ({'; '.join(wrong[:MOST_SHOWN])})" if wrong else ""
    return Result(words, holds, figure, limit)


def quantile(values: Sequence[float], share: float) -> float:
    """Return the value at or below which ``share`` of the values lie; 0 without values."""
    return sorted(values)[max(0, ceil(len(values) * share) - 1)] if values else 0.0


def _three(values: Sequence[float]) -> str:
    return "/".join(f"{quantile(values, share):.1f}" for share in (0.5, 0.95, 1.0))
