"""Row: thirty tasks, one after another, each measured where the rover then stands."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import ceil, cos, degrees, hypot, radians, remainder, sin, tau
from statistics import fmean

from mav_tasks.client.wire import Goal
from mav_tasks.kinds import GoTo, LocalPlace, Move, Rotate
from rover_sim.observing.track import Place
from rover_sim.trial.session import End, Result, Session

WITHIN = 300.0  # s for one task, at 0.5 m/s: 45 m to a mission of 30 m, and curves
MOST_SHOWN = 4  # failures shown
UNABLE = ("not turn", "not reverse", "cannot turn")  # in refusals of impossible tasks
Point = tuple[float, float]  # north and east, m


@dataclass(frozen=True, slots=True)
class TrialTask:
    """One task: words, goals, and the expected end in reported coordinates."""

    words: str
    goals: tuple[Goal, ...]
    end: Point | None = None  # None: a turn, or unknown
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
    return TrialTask(words, tuple(GoTo(LocalPlace(*place)) for place in places), places[-1])


def _offset(place: Place, forward: float, right: float) -> Point:
    north = place.north + forward * cos(place.yaw) - right * sin(place.yaw)
    return north, place.east + forward * sin(place.yaw) + right * cos(place.yaw)


@dataclass(frozen=True, slots=True)
class Driven:
    """One completed task, in true and in reported places, before and after."""

    asked: TrialTask
    before: Place
    after: Place
    told: Place
    told_after: Place

    def turned_wrong(self) -> float:
        """Return the error of a turn, degrees."""
        wanted = self.asked.turn or 0.0
        return degrees(abs(remainder(self.after.yaw - self.before.yaw - wanted, tau)))

    def off(self, shift: tuple[float, float]) -> float:
        """Return the error of the end, m.

        A move should end at its distance from its true start, along the reported heading. A place
        is in the rover's frame, which is shifted against the true one.
        """
        assert self.asked.end is not None
        if self.asked.is_relative:
            shift = self.before.north - self.told.north, self.before.east - self.told.east
        return self._apart(self.after, shift)

    def off_by_estimate(self) -> float:
        """Return the error of the reported end, m: the part that the server causes."""
        return self._apart(self.told_after, (0.0, 0.0))

    def _apart(self, at: Place, shift: tuple[float, float]) -> float:
        assert self.asked.end is not None
        north, east = self.asked.end
        return hypot(at.north - north - shift[0], at.east - east - shift[1])


@dataclass(slots=True)
class Tally:
    """Results of the tasks so far."""

    ends: list[tuple[TrialTask, End]] = field(default_factory=list)
    refused: int = 0
    driven: list[Driven] = field(default_factory=list)
    shifts: list[tuple[float, float]] = field(default_factory=list)

    def add_shift(self, true: Place, told: Place) -> None:
        """Add the offset between the true and the reported frame, measured at rest."""
        self.shifts.append((true.north - told.north, true.east - told.east))

    @property
    def shift(self) -> tuple[float, float]:
        """The mean offset of the frames, m; averaging reduces the estimate's error in each."""
        return fmean(north for north, _ in self.shifts), fmean(east for _, east in self.shifts)


async def drive_tasks(session: Session) -> Result:
    """Drive the thirty tasks."""
    tally = Tally()
    true = await session.rest()
    begun = session.told.last
    tally.add_shift(true, begun)
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
    tally.add_shift(after, session.told.last)
    shown = f"  {asked.words}: {end}, {end.seconds:.1f} s"
    if not end.is_completed:
        session.say(shown)
        await session.clean()
        return
    driven = Driven(asked, before, after, told, session.told.last)
    tally.driven.append(driven)
    if asked.turn is not None:
        shown += f", {driven.turned_wrong():.2f} deg off"
    elif asked.end is not None:
        believed = driven.off_by_estimate() * 100
        shown += f", {driven.off(tally.shift) * 100:.1f} cm off, {believed:.1f} by its estimate"
    session.say(shown)


def _result(session: Session, tally: Tally) -> Result:
    limits = session.limits
    states = Counter(end.state for _, end in tally.ends)
    words = ", ".join(f"{count} {state}" for state, count in sorted(states.items()))
    words += f"; {tally.refused} refused" if tally.refused else ""
    moved = [each for each in tally.driven if each.asked.end is not None]
    metres = sorted(each.off(tally.shift) * 100 for each in moved)
    believed = sorted(each.off_by_estimate() * 100 for each in moved)
    angles = sorted(each.turned_wrong() for each in tally.driven if each.asked.turn is not None)
    figure = f"end p50/p95/max {_three(metres)} cm, by its estimate {_three(believed)}"
    limit = f"p95 {limits.end * 100:g} cm"
    if angles:
        figure += f", turns {_three(angles)} deg"
        limit += f", {limits.turn:g} deg"
    holds = len(tally.driven) == len(tally.ends) > 0
    holds = holds and quantile(metres, 0.95) <= limits.end * 100
    holds = holds and quantile(angles, 0.95) <= limits.turn
    wrong = [f"{asked.words}: {end}" for asked, end in tally.ends if not end.is_completed]
    words += f" ({'; '.join(wrong[:MOST_SHOWN])})" if wrong else ""
    return Result(words, holds, figure, limit)


def quantile(ordered: Sequence[float], share: float) -> float:
    """Return the value at or below which ``share`` of the values lie; 0 without values."""
    return ordered[max(0, ceil(len(ordered) * share) - 1)] if ordered else 0.0


def _three(ordered: Sequence[float]) -> str:
    return "/".join(f"{quantile(ordered, share):.1f}" for share in (0.5, 0.95, 1.0))
