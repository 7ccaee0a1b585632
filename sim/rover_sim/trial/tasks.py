"""Row: thirty tasks, one after another, each measured where the rover then stands."""

from cmath import rect
from collections import Counter
from collections.abc import Sequence
from math import ceil, degrees, radians, remainder, tau
from typing import NamedTuple

from mav_tasks.client.wire import Goal
from mav_tasks.kinds import GoTo, LocalPlace, Move, Rotate
from rover_sim.observing.track import Place
from rover_sim.trial.session import End, Result, Session

WITHIN = 300.0  # s for one task, at 0.5 m/s: 45 m to a mission of 30 m, and curves
MOST_SHOWN = 4  # failures shown
UNABLE = ("not turn", "not reverse", "cannot turn")  # in refusals of impossible tasks
#: m north, and m east as the imaginary part: a rotation is a product, and abs() a distance
Vector = complex

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


class Driven(NamedTuple):
    """One task, how it ended, and how far it was off."""

    words: str
    end: End
    #: cm; from its true start the rover should come as far as its reported place asked for
    off: float | None = None
    believed: float | None = None  # cm, by its estimate: the server's part
    angle: float | None = None  # degrees, of a turn


def task_of(
    words: str, now: Place, begun: Place
) -> tuple[tuple[Goal, ...], Vector | None, float | None]:
    """Return goals, expected end in reported coordinates, and turn (rad), as far as known.

    ``now`` and ``begun`` are the reported places now and at the start of the trial.
    """
    kind, *numbers = words.split()
    values = [float(number) for number in numbers]
    match kind:
        case "move":
            return (Move(values[0]),), _offset(now, values[0], 0.0), None
        case "turn":
            angle = radians(values[0])
            return (Rotate(angle),), None, angle
        case "return":  # to a place that the trial does not know
            return (GoTo(None),), None, None
    base = now if kind == "near" else begun
    places = [_offset(base, *pair) for pair in zip(values[::2], values[1::2], strict=True)]
    goals = tuple(GoTo(LocalPlace(place.real, place.imag)) for place in places)
    return goals, places[-1], None


def _at(place: Place) -> Vector:
    return complex(place.north, place.east)


def _offset(place: Place, forward: float, right: float) -> Vector:
    return _at(place) + complex(forward, right) * rect(1.0, place.yaw)


async def drive_tasks(session: Session) -> Result:
    """Drive the thirty tasks."""
    await session.rest()
    begun, driven, refused = session.told.last, list[Driven](), 0
    left, instead = TASKS.split(", "), FURTHER.split(", ")
    while left:
        one = await _drive_one(session, left.pop(0), begun)
        if one is None:
            refused += 1
        else:
            driven.append(one)
        if len(left) == 1:  # before the way home
            left[:0], instead = instead[:refused], []
    return _result(session, driven, refused)


async def _drive_one(session: Session, words: str, begun: Place) -> Driven | None:
    """Return what came of one task, None if the rover cannot do that."""
    before, told = session.track.last, session.told.last
    goals, place, turn = task_of(words, told, begun)
    end = await session.drive(goals, within=WITHIN)
    if end.state == "REFUSED" and any(word in end.words for word in UNABLE):
        session.say(f"  {words}: refused: {end.words}")
        return None
    after = await session.rest()
    one, shown = Driven(words, end), ""
    if not end.is_completed:
        await session.clean()
    elif turn is not None:
        one = one._replace(angle=degrees(abs(remainder(after.yaw - before.yaw - turn, tau))))
        shown = f", {one.angle:.2f} deg off"
    elif place is not None:
        off = _at(after) - _at(before) - (place - _at(told))
        believed = _at(session.told.last) - place
        one = one._replace(off=abs(off) * 100, believed=abs(believed) * 100)
        shown = f", {one.off:.1f} cm off, {one.believed:.1f} by its estimate"
    session.say(f"  {words}: {end}, {end.seconds:.1f} s{shown}")
    return one


def _result(session: Session, driven: Sequence[Driven], refused: int) -> Result:
    limits = session.limits
    states = Counter(one.end.state for one in driven)
    words = ", ".join(f"{count} {state}" for state, count in sorted(states.items()))
    words += f"; {refused} refused" if refused else ""
    off, believed, angles = (
        sorted(each for one in driven if (each := getattr(one, name)) is not None)
        for name in ("off", "believed", "angle")
    )
    figure = f"end p50/p95/max {_three(off)} cm, by its estimate {_three(believed)}"
    limit = f"p95 {limits.end * 100:g} cm"
    if angles:
        figure += f", turns {_three(angles)} deg"
        limit += f", {limits.turn:g} deg"
    wrong = [f"{one.words}: {one.end}" for one in driven if not one.end.is_completed]
    holds = bool(driven) and not wrong and quantile(off, 0.95) <= limits.end * 100
    words += f" ({'; '.join(wrong[:MOST_SHOWN])})" if wrong else ""
    return Result(words, holds and quantile(angles, 0.95) <= limits.turn, figure, limit)


def quantile(ordered: Sequence[float], share: float) -> float:
    """Return the value at or below which ``share`` of the values lie; 0 without values."""
    return ordered[max(0, ceil(len(ordered) * share) - 1)] if ordered else 0.0


def _three(ordered: Sequence[float]) -> str:
    return "/".join(f"{quantile(ordered, share):.1f}" for share in (0.5, 0.95, 1.0))
