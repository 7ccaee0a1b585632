"""What a task can be about: frozen values. SI units and radians; angles clockwise from north."""

from dataclasses import dataclass
from math import degrees


@dataclass(frozen=True, slots=True)
class Move:
    """Drive straight along the heading at the start.

    ``distance`` in metres, negative = backwards; ``speed`` in m/s, positive, None = default.
    """

    distance: float
    speed: float | None = None


@dataclass(frozen=True, slots=True)
class Rotate:
    """Turn on the spot: ``angle`` in radians, clockwise positive, may exceed a full turn.

    ``rate`` in rad/s, positive, None = default.
    """

    angle: float
    rate: float | None = None


@dataclass(frozen=True, slots=True)
class Drive:
    """Keep a velocity for a time: m/s forward, rad/s clockwise, ``duration`` in seconds."""

    forward: float
    yaw_rate: float
    duration: float


@dataclass(frozen=True, slots=True)
class LocalPlace:
    """A place in the vehicle's own local frame, metres north and east of its origin."""

    north: float
    east: float


@dataclass(frozen=True, slots=True)
class GlobalPlace:
    """A place on earth, exact as MAVLink's integers have it."""

    latitude_degE7: int
    longitude_degE7: int


Place = LocalPlace | GlobalPlace


@dataclass(frozen=True, slots=True)
class GoTo:
    """Drive to a place in a straight line, facing forward.

    ``place`` None is the vehicle's home. ``speed`` in m/s, None = default. ``radius`` in metres is
    near enough, None = as near as a move ends. ``yaw`` in radians is turned to in the end, None =
    as it comes. ``wait`` in seconds is spent there, standing.
    """

    place: Place | None
    speed: float | None = None
    radius: float | None = None
    yaw: float | None = None
    wait: float = 0.0


@dataclass(frozen=True, slots=True)
class Face:
    """Turn on the spot to a heading.

    ``yaw`` in radians from north; ``direction`` 1 clockwise, -1 counter-clockwise, 0 the shorter
    way; ``rate`` in rad/s, None = default.
    """

    yaw: float
    direction: int = 0
    rate: float | None = None


@dataclass(frozen=True, slots=True)
class Head:
    """Drive towards a heading for a time: ``yaw`` in radians, ``forward`` in m/s.

    ``is_relative``: the yaw counts from the heading at the start.
    """

    yaw: float
    forward: float
    duration: float
    is_relative: bool = False


@dataclass(frozen=True, slots=True)
class Wait:
    """Stand for ``duration`` seconds."""

    duration: float


Goal = Move | Rotate | Drive | GoTo | Face | Head | Wait


def describe(goal: Goal) -> str:
    """Give a goal in words, and in the units of its command."""
    if isinstance(goal, GoTo):
        return _describe_way(goal.place)
    match goal:
        case Move(distance=distance):
            return f"move {distance:g} m"
        case Rotate(angle=angle):
            return f"rotate {degrees(angle):.6g} deg"
        case Drive(forward=forward, duration=duration):
            return f"drive {forward:g} m/s for {duration:g} s"
        case Face(yaw=yaw):
            return f"face {degrees(yaw) % 360:.6g} deg"
        case Head(forward=forward, duration=duration):
            return f"head {forward:g} m/s for {duration:g} s"
        case Wait(duration=duration):
            return f"wait {duration:g} s"


def _describe_way(place: Place | None) -> str:
    match place:
        case None:
            return "return home"
        case LocalPlace(north=north, east=east):
            return f"go to {north:.2f} m N, {east:.2f} m E"
        case GlobalPlace(latitude_degE7=latitude, longitude_degE7=longitude):
            return f"go to {latitude / 1e7:.6f}, {longitude / 1e7:.6f}"
