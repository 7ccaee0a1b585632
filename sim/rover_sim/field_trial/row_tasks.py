"""Row: thirty tasks, one after the other, each measured where the rover then stands."""

from collections import Counter
from dataclasses import dataclass, field
from math import atan2, cos, degrees, hypot, remainder, sin, tau

from rover_sim.field_trial.goals import Asked, Maker, Where, further, plan
from rover_sim.field_trial.rows import Row, judged, quantile
from rover_sim.field_trial.session import End, Session
from rover_sim.field_trial.track import Place

NAME = "tasks"
WITHIN = 180.0  # s for one task: 30 m at the slowest default, 0.5 m/s, and a mission of 30 m
MOST_SHOWN = 4  # of what went wrong
UNABLE = ("not turn", "not reverse", "cannot turn")  # in refusals of what the rover cannot do


@dataclass(slots=True)
class Tally:
    """What came of the tasks so far."""

    ends: list[tuple[Asked, End]] = field(default_factory=list)
    refused: list[Asked] = field(default_factory=list)
    metres: list[float] = field(default_factory=list)
    degrees: list[float] = field(default_factory=list)

    @property
    def driven(self) -> int:
        """How many were driven to their ends."""
        return sum(end.is_completed for _, end in self.ends)


async def drive_tasks(session: Session) -> Row:
    """Drive them."""
    tally = Tally()
    true = await session.rest()
    told = session.told_place()
    shift = true.north - told.north, true.east - told.east
    makers, instead = list(plan()), list(further())
    while makers:
        maker = makers.pop(0)
        await _drive_one(session, maker, Where(session.told_place(), told), shift, tally)
        if len(makers) == 1:  # before the way home make up for what was turned down
            missing = len(tally.refused)
            makers[:0], instead = instead[:missing], []
    return _row(session, tally)


async def _drive_one(
    session: Session,
    maker: Maker,
    where: Where,
    shift: tuple[float, float],
    tally: Tally,
) -> None:
    asked = maker(where)
    before = session.track.last
    end = await session.drive(asked.goals, within=WITHIN)
    if _is_turned_down(end):
        session.say(f"  {asked.words}: turned down: {end.words}")
        tally.refused.append(asked)
        return
    after = await session.rest()
    tally.ends.append((asked, end))
    told_error = ""
    if end.is_completed:
        told_error = _measure(asked, before, after, where, shift, tally)
    session.say(f"  {asked.words}: {end}, {end.seconds:.1f} s{told_error}")
    if not end.is_completed:
        await session.clean()


def _is_turned_down(end: End) -> bool:
    """Whether the rover was said to be unable: no failure, if it is."""
    return end.state == "REFUSED" and (any(word in end.words for word in UNABLE))


def _measure(
    asked: Asked,
    before: Place,
    after: Place,
    where: Where,
    shift: tuple[float, float],
    tally: Tally,
) -> str:
    if asked.turn is not None:
        wrong = degrees(abs(remainder(after.yaw - before.yaw - asked.turn, tau)))
        tally.degrees.append(wrong)
        return f", {wrong:.2f} deg off"
    assert asked.end is not None
    if len(asked.goals) == 1 and asked.words.startswith("move"):
        north = before.north + asked.end.north - where.now.north
        east = before.east + asked.end.east - where.now.east
    else:
        north, east = asked.end.north + shift[0], asked.end.east + shift[1]
    off_north, off_east = after.north - north, after.east - east
    tally.metres.append(hypot(off_north, off_east))
    course = atan2(north - before.north, east - before.east)
    along = off_north * sin(course) + off_east * cos(course)
    across = off_east * sin(course) - off_north * cos(course)
    return f", {hypot(along, across) * 100:.1f} cm off ({along * 100:+.1f} on, {across * 100:+.1f} right)"


def _row(session: Session, tally: Tally) -> Row:
    limits = session.limits
    states = Counter(end.state for _, end in tally.ends)
    result = ", ".join(f"{count} {state}" for state, count in sorted(states.items()))
    if tally.refused:
        result += f"; {len(tally.refused)} turned down"
    metres, angles = tally.metres, tally.degrees
    figure = f"end p50/p95/max {_three(metres, 100)} cm"
    limit = f"p95 {limits.end * 100:g} cm"
    if angles:
        figure += f", turns {_three(angles, 1)} deg"
        limit += f", {limits.turn:g} deg"
    holds = (
        tally.driven == len(tally.ends) > 0
        and quantile(metres, 0.95) <= limits.end
        and quantile(angles, 0.95) <= limits.turn
    )
    wrong = [f"{asked.words}: {end}" for asked, end in tally.ends if not end.is_completed]
    if wrong:
        result += " (" + "; ".join(wrong[:MOST_SHOWN]) + ")"
    return judged(NAME, f"{len(tally.ends)} tasks", result=result, figure=figure, limit=limit, holds=holds)


def _three(values: list[float], factor: float) -> str:
    shares = (quantile(values, 0.5), quantile(values, 0.95), max(values, default=0.0))
    return "/".join(f"{value * factor:.1f}" for value in shares)
