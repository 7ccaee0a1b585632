"""GoTo: drive to a place, or home."""

from dataclasses import dataclass
from typing import Any

from mav_tasks.kinds.form import DEGREE, HEADING, SPEED, Form, any_number, positive
from mav_tasks.setting_keys.parts import Part
from mav_tasks.setting_keys.shapes import Number

E7 = 1e7  # degE7 of a degree: MAVLink's integers


@dataclass(frozen=True, slots=True)
class LocalPlace:
    """A place in the vehicle's own local frame, metres north and east of its origin."""

    north: float
    east: float


@dataclass(frozen=True, slots=True)
class GlobalPlace:
    """A place on earth, exactly as MAVLink's integers give it."""

    latitude_degE7: int
    longitude_degE7: int


Place = LocalPlace | GlobalPlace


@dataclass(frozen=True, slots=True)
class GoTo:
    """Drive to a place in a straight line, facing forward.

    ``place`` None is the vehicle's home. ``speed`` in m/s, None = default. ``radius`` is the
    acceptance radius in metres, None = the tolerance of a move. ``yaw`` is the heading in radians
    to turn to on arrival, None = any. ``wait`` is the seconds to stand there. ``passes``: in a
    plan, the vehicle does not stop at the place if another one follows. With ``turns`` it drives
    that many turns round the place instead, ``around`` metres from it, negative =
    counter-clockwise. ``backwards``: it drives there backwards.
    """

    place: Place | None
    speed: float | None = None
    radius: float | None = None
    yaw: float | None = None
    wait: float = 0.0
    passes: bool = False
    turns: float = 0.0
    around: float = 0.0
    backwards: bool = False

    @property
    def rule(self) -> str:
        return "return" if self.place is None else "goto"

    @property
    def words(self) -> str:
        match self.place:
            case None:
                return "return home"
            case LocalPlace(north=north, east=east):
                return f"go to {north:.2f} m N, {east:.2f} m E"
            case GlobalPlace(latitude_degE7=latitude, longitude_degE7=longitude):
                return f"go to {latitude / E7:.6f}, {longitude / E7:.6f}"

    @property
    def named_speed(self) -> float:
        return self.speed or 0.0


def _local(north: float, east: float, **others: Any) -> GoTo:
    return _way(LocalPlace(north, east), **others)


def _global(latitude: float, longitude: float, **others: Any) -> GoTo:
    return _way(GlobalPlace(round(latitude * E7), round(longitude * E7)), **others)


def _way(place: Place, *, heading: float | None, wait: float | None, **others: Any) -> GoTo:
    return GoTo(place, yaw=heading, wait=wait or 0.0, **others)


def _home(speed: float | None) -> GoTo:
    return GoTo(None, speed)


ON_EARTH = (
    Part("latitude", Number(-90.0, 90.0, "deg"), "latitude, WGS 84", True),
    Part("longitude", Number(-180.0, 180.0, "deg"), "longitude, WGS 84", True),
)
ON_ARRIVAL = (
    Part("radius", positive("m"), "acceptance radius; as close as possible if not given"),
    Part("heading", any_number("deg", DEGREE), f"final {HEADING}; any if not given"),
    Part("wait", positive("s"), "how long to stand there; 0 if not given"),
)
FORMS = (
    Form(
        "goto",
        "Go to (metres)",
        "Drive to a place in the rover's local frame.",
        (
            Part("north", any_number("m"), "metres north of the local origin", True),
            Part("east", any_number("m"), "metres east of the local origin", True),
            SPEED,
            *ON_ARRIVAL,
        ),
        _local,
    ),
    Form(
        "goto_global",
        "Go to (latitude, longitude)",
        "Drive to a place on earth.",
        (*ON_EARTH, SPEED, *ON_ARRIVAL),
        _global,
    ),
    Form("home", "Return home", "Return to the nearest rally point, else home.", (SPEED,), _home),
)
