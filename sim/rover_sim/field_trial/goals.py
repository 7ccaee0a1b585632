"""The thirty tasks: goals, and expected ends."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import cos, pi, radians, sin

from mav_tasks.client.wire import Goal
from mav_tasks.kinds import GoTo, LocalPlace, Move, Rotate
from rover_sim.field_trial.track import Place

COUNT = 30  # tasks to drive
FAR = 30.0  # m, the longest go-to
NEAR = 3.0  # m


@dataclass(frozen=True, slots=True)
class Where:
    """The reported place of the rover, now and at the start of the trial."""

    now: Place
    begun: Place

    def ahead(self, forward: float, right: float) -> LocalPlace:
        """Return the place at this offset from the trial's start pose."""
        yaw = self.begun.yaw
        north = self.begun.north + forward * cos(yaw) - right * sin(yaw)
        east = self.begun.east + forward * sin(yaw) + right * cos(yaw)
        return LocalPlace(north, east)


@dataclass(frozen=True, slots=True)
class TrialTask:
    """One task: description, goals, and the expected end in reported coordinates."""

    words: str
    goals: tuple[Goal, ...]
    end: Place | None = None  # None: a turn, or unknown
    turn: float | None = None  # rad
    is_relative: bool = False  # to the rover's place at its start, as for a move


Maker = Callable[[Where], TrialTask]


def move(distance: float) -> Maker:
    """Return a maker of a move along the heading."""

    def make(where: Where) -> TrialTask:
        yaw = where.now.yaw
        end = where.now.moved(distance * cos(yaw), distance * sin(yaw))
        return TrialTask(f"move {distance:g} m", (Move(distance),), end, is_relative=True)

    return make


def turn(angle: float) -> Maker:
    """Return a maker of a turn on the spot, deg."""

    def make(_where: Where) -> TrialTask:
        return TrialTask(f"turn {angle:g} deg", (Rotate(radians(angle)),), turn=radians(angle))

    return make


def go(forward: float, right: float) -> Maker:
    """Return a maker of a go-to, relative to the trial's start pose."""

    def make(where: Where) -> TrialTask:
        place = where.ahead(forward, right)
        end = Place(0.0, place.north, place.east, 0.0)
        return TrialTask(f"go to {forward:g}, {right:g} m", (GoTo(place),), end)

    return make


def near(distance: float) -> Maker:
    """Return a maker of a go-to ahead of the rover."""

    def make(where: Where) -> TrialTask:
        yaw = where.now.yaw
        end = where.now.moved(distance * cos(yaw), distance * sin(yaw))
        return TrialTask(f"go {distance:g} m ahead", (GoTo(LocalPlace(end.north, end.east)),), end)

    return make


def mission(where: Where) -> TrialTask:
    """Return a mission of five places, 6 m apart on an arc wide enough for Ackermann steering."""
    bearings = (0.0, pi / 4, pi / 2, 3 * pi / 4, pi)
    forward, right, places = 4.0, 0.0, []
    for bearing in bearings:
        forward += 6.0 * cos(bearing)
        right += 6.0 * sin(bearing)
        places.append(where.ahead(forward, right))
    last = places[-1]
    goals = tuple(GoTo(place) for place in places)
    return TrialTask("mission of 5", goals, Place(0.0, last.north, last.east, 0.0))


def home(where: Where) -> TrialTask:
    """Return a go-to home, the place that the rover says, which the trial does not know."""
    del where
    return TrialTask("return", (GoTo(None),))


def plan() -> Sequence[Maker]:
    """Return the thirty tasks; ``further`` replaces those that the rover cannot drive."""
    return (
        *(move(0.3), move(0.5), turn(90), move(1.0), turn(-90), move(2.0), move(-1.0), turn(45)),
        *(move(0.3), turn(-45), move(3.0), turn(180), move(3.0), turn(120), turn(60), near(NEAR)),
        *(go(FAR, 0.0), go(20.0, 8.0), move(0.5), turn(-120), move(-1.0), go(0.0, 0.0), move(10.0)),
        *(turn(30), move(1.0), move(5.0), mission, move(0.3), move(2.0), home),
    )


def further() -> Sequence[Maker]:
    """Return replacements for tasks that the rover cannot drive, for use before the way home."""
    return (
        *(near(NEAR), move(0.3), move(0.5), move(1.0), go(10.0, 4.0), move(2.0), near(NEAR)),
        *(move(0.3), go(18.0, -4.0), move(1.0), move(0.5), move(0.3), go(2.0, 0.0)),
    )
