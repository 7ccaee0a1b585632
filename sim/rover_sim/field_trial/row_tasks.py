"""Row: thirty tasks, one after another, each measured where the rover then stands."""

from collections import Counter
from dataclasses import dataclass, field
from math import degrees, hypot, remainder, tau
from statistics import fmean

from rover_sim.field_trial.goals import Maker, TrialTask, Where, further, plan
from rover_sim.field_trial.rows import Row, judged, quantile
from rover_sim.field_trial.session import End, Session
from rover_sim.field_trial.track import Place

NAME = "tasks"
WITHIN = 300.0  # s for one task, at 0.5 m/s: 45 m to a mission of 30 m, and curves
MOST_SHOWN = 4  # failures shown
UNABLE = ("not turn", "not reverse", "cannot turn")  # in refusals of impossible tasks


@dataclass(frozen=True, slots=True)
class Driven:
    """One completed task, in true and in reported places."""

    asked: TrialTask
    before: Place
    after: Place
    told: Place  # reported place before
    told_after: Place


@dataclass(slots=True)
class Tally:
    """Results of the tasks so far."""

    ends: list[tuple[TrialTask, End]] = field(default_factory=list)
    refused: list[TrialTask] = field(default_factory=list)
    driven: list[Driven] = field(default_factory=list)
    shifts: list[tuple[float, float]] = field(default_factory=list)

    def add_shift(self, true: Place, told: Place) -> None:
        """Add the offset between the true and the reported frame, measured at rest."""
        self.shifts.append((true.north - told.north, true.east - told.east))

    @property
    def shift(self) -> tuple[float, float]:
        """The mean offset of the frames, m; averaging reduces the estimate's error in each."""
        return fmean(north for north, _ in self.shifts), fmean(east for _, east in self.shifts)


async def drive_tasks(session: Session) -> Row:
    """Drive the thirty tasks."""
    tally = Tally()
    true = await session.rest()
    begun = session.told_place()
    tally.add_shift(true, begun)
    makers, instead = list(plan()), list(further())
    while makers:
        await _drive_one(session, makers.pop(0), begun, tally)
        if len(makers) == 1:  # before the way home, replace the refused tasks
            missing = len(tally.refused)
            makers[:0], instead = instead[:missing], []
    return _row(session, tally)


async def _drive_one(session: Session, maker: Maker, begun: Place, tally: Tally) -> None:
    told = session.told_place()
    asked = maker(Where(told, begun))
    before = session.track.last
    end = await session.drive(asked.goals, within=WITHIN)
    if _is_turned_down(end):
        session.say(f"  {asked.words}: refused: {end.words}")
        tally.refused.append(asked)
        return
    after = await session.rest()
    tally.ends.append((asked, end))
    tally.add_shift(after, session.told_place())
    wrong = ""
    if end.is_completed:
        driven = Driven(asked, before, after, told, session.told_place())
        tally.driven.append(driven)
        wrong = _shown(driven, tally.shift)
    session.say(f"  {asked.words}: {end}, {end.seconds:.1f} s{wrong}")
    if not end.is_completed:
        await session.clean()


def _is_turned_down(end: End) -> bool:
    """Return whether the server refused a task that the rover cannot drive, which is no failure."""
    return end.state == "REFUSED" and (any(word in end.words for word in UNABLE))


def _turned_wrong(driven: Driven) -> float:
    """Return the error of a turn, degrees."""
    assert driven.asked.turn is not None
    turned = driven.after.yaw - driven.before.yaw
    return degrees(abs(remainder(turned - driven.asked.turn, tau)))


def _off(driven: Driven, shift: tuple[float, float]) -> tuple[float, float]:
    """Return the error of the end, north and east, m.

    A move should end at its distance from its true start, along the reported heading. A place is in
    the rover's frame, which is shifted against the true one.
    """
    end = driven.asked.end
    assert end is not None
    if driven.asked.is_relative:
        north = driven.before.north + end.north - driven.told.north
        east = driven.before.east + end.east - driven.told.east
    else:
        north, east = end.north + shift[0], end.east + shift[1]
    return driven.after.north - north, driven.after.east - east


def _shown(driven: Driven, shift: tuple[float, float]) -> str:
    if driven.asked.turn is not None:
        return f", {_turned_wrong(driven):.2f} deg off"
    if driven.asked.end is None:
        return ""
    north, east = _off(driven, shift)
    return (
        f", {hypot(north, east) * 100:.1f} cm off ({north * 100:+.1f} N, {east * 100:+.1f} E),"
        f" by its estimate {_off_by_estimate(driven) * 100:.1f}"
    )


def _off_by_estimate(driven: Driven) -> float:
    """Return the error of the reported end, m: the part that the server causes."""
    end, told = driven.asked.end, driven.told_after
    assert end is not None
    return hypot(told.north - end.north, told.east - end.east)


def _row(session: Session, tally: Tally) -> Row:
    limits = session.limits
    states = Counter(end.state for _, end in tally.ends)
    result = ", ".join(f"{count} {state}" for state, count in sorted(states.items()))
    if tally.refused:
        result += f"; {len(tally.refused)} refused"
    moved = [each for each in tally.driven if each.asked.end is not None]
    metres = [hypot(*_off(each, tally.shift)) for each in moved]
    angles = [_turned_wrong(each) for each in tally.driven if each.asked.turn is not None]
    believed = [_off_by_estimate(each) for each in moved]
    figure = f"end p50/p95/max {_three(metres, 100)} cm, by its estimate {_three(believed, 100)}"
    limit = f"p95 {limits.end * 100:g} cm"
    if angles:
        figure += f", turns {_three(angles, 1)} deg"
        limit += f", {limits.turn:g} deg"
    holds = (
        len(tally.driven) == len(tally.ends) > 0
        and quantile(metres, 0.95) <= limits.end
        and quantile(angles, 0.95) <= limits.turn
    )
    wrong = [f"{asked.words}: {end}" for asked, end in tally.ends if not end.is_completed]
    if wrong:
        result += " (" + "; ".join(wrong[:MOST_SHOWN]) + ")"
    return judged(
        NAME, f"{len(tally.ends)} tasks", result=result, figure=figure, limit=limit, holds=holds
    )


def _three(values: list[float], factor: float) -> str:
    shares = (quantile(values, 0.5), quantile(values, 0.95), max(values, default=0.0))
    return "/".join(f"{value * factor:.1f}" for value in shares)
