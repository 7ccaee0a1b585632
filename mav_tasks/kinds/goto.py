"""GoTo: drive to a place, or home."""

from dataclasses import dataclass, replace
from math import degrees, inf, pi, radians, tau
from typing import Any, ClassVar

from mav_tasks.config.setting_keys.parts import Part
from mav_tasks.config.setting_keys.shapes import Number
from mav_tasks.config.settings import Driving
from mav_tasks.kinds.base import FACE, WAY, Ability, Base, Begun, anchor_in
from mav_tasks.kinds.follow import Follow
from mav_tasks.kinds.form import DEGREE, HEADING, SPEED, Form, any_number, positive
from mav_tasks.kinds.move import Move
from mav_tasks.kinds.params import (
    MAX_WAIT,
    Given,
    Parsers,
    bad,
    heading_in,
    needed_place,
    number,
    place_in,
    speed_or_default,
    whole,
)
from mav_tasks.kinds.path import bearing, distance, wrap
from mav_tasks.kinds.places import GlobalPlace, LocalPlace, Place, Pose
from mav_tasks.kinds.rotate import Rotate, turn_to
from mav_tasks.kinds.sent import Sent
from mav_tasks.kinds.wait import Wait
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.mavlink.float_param import EXACT

E7 = 1e7  # degE7 of a degree: MAVLink's integers
ON_THE_SPOT = 0.01  # m, acceptance radius if none is given
STOPPING = 0.01  # s, least hold time of a stop: a waypoint without hold is passed
NORTH = 360.0  # deg, sent for north: 0 would mean "no heading"
LEAST_YAW = 1e-4  # deg; a smaller yaw is sent as NORTH
OWN_DEFAULT = -2.0  # DO_CHANGE_SPEED: the configured speed


@dataclass(frozen=True, slots=True)
class GoTo(Base):
    """Drive to a place in a straight line, facing forward.

    ``place`` None is the vehicle's home. ``speed`` in m/s, None = default. ``radius`` is the
    acceptance radius in metres, None = the tolerance of a move. ``yaw`` is the heading in radians
    to turn to on arrival, None = any. ``wait`` is the seconds to stand there. ``passes``: in a
    plan, the vehicle does not stop at the place if another one follows. With ``turns`` it drives
    that many turns round the place instead, ``around`` metres from it, negative =
    counter-clockwise. ``backwards``: it drives there backwards.
    """

    is_absolute: ClassVar[bool] = True
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

    def as_driven(self, ability: Ability) -> tuple["GoTo", str]:
        """Without the final heading where the autopilot ignores it, too: clients name one
        without meaning it.
        """
        if self.yaw is None or ability.drives_everything:
            return self, ""
        words = f"{ability.rover} steers like a car: the final heading is ignored"
        return replace(self, yaw=None), words if ability.is_steered else ""

    @property
    def leg_count(self) -> int:
        return 2 + (self.yaw is not None) + (self.wait > 0)

    def heading_to(self, pose: Pose, target: LocalPlace) -> float:
        """Return the heading of the vehicle when it drives straight to a place."""
        return bearing(pose, target) + pi * self.backwards

    def anchor_of(self, leg: int, pose: Pose, target: LocalPlace | None) -> Pose:
        if leg != WAY:
            return pose
        assert target is not None, "the place was found before the task began"
        return replace(pose, yaw=self.heading_to(pose, target))

    def end_of(self, progress: Begun) -> LocalPlace | None:
        return progress.target

    def leg_of(self, progress: Begun) -> Move | Rotate | Follow | Wait:
        anchor, target = anchor_in(progress), progress.target
        if progress.leg > WAY:
            if progress.leg == WAY + 1 and self.yaw is not None:
                return Rotate(turn_to(anchor.yaw, self.yaw, 0))
            return Wait(self.wait)
        assert target is not None, "the place was found before the task began"
        if progress.path:
            return Follow(progress.path, self.speed)
        if progress.leg == FACE:
            return Rotate(wrap(self.heading_to(anchor, target) - anchor.yaw))
        way = distance(anchor, target)
        if self.turns:  # only to estimate it: the way onto it is planned when it begins
            return Move(way + tau * self.turns * abs(self.around), self.speed)
        return Move(-way if self.backwards else way, self.speed)

    @property
    def sent(self) -> tuple[Sent, ...]:
        """The items; a speed is set before the way, and the default after it."""
        way = self._home if self.place is None else self._way(self.place)
        if self.speed is None:
            return (way,)
        return _speed(self.speed), way, _speed(OWN_DEFAULT)

    @property
    def _home(self) -> Sent:
        if self.wait or self.yaw is not None or self.radius:
            words = "a return home takes only a speed; add a Wait or Face after it"
            raise ValueError(f"{self}: {words}")
        return Sent(MavCmd.NAV_RETURN_TO_LAUNCH)

    def _way(self, place: Place) -> Sent:
        wait = self.wait if self.passes else max(self.wait, STOPPING)
        radius = self.radius or (0.0 if self.passes else ON_THE_SPOT)
        yaw = 0.0
        if self.yaw is not None:
            yaw = degrees(self.yaw) % 360.0
            yaw = NORTH if yaw < LEAST_YAW else yaw
        return Sent(MavCmd.NAV_WAYPOINT, wait, radius, 0.0, yaw, *place.sent)


def _speed(speed: float) -> Sent:
    return Sent(MavCmd.DO_CHANGE_SPEED, 1.0, speed, -1.0)


def _local(north: float, east: float, **others: Any) -> GoTo:
    return _way(LocalPlace(north, east), **others)


def _global(latitude: float, longitude: float, **others: Any) -> GoTo:
    return _way(GlobalPlace(round(latitude * E7), round(longitude * E7)), **others)


def _way(place: Place, *, heading: float | None, wait: float | None, **others: Any) -> GoTo:
    return GoTo(place, yaw=heading, wait=wait or 0.0, **others)


def _home(speed: float | None) -> GoTo:
    return GoTo(None, speed)


CHANGE_MODE, RELATIVE_YAW = 1, 2  # MAV_DO_REPOSITION_FLAGS
MAX_FLAGS = EXACT  # of a bit mask in a float32


def _waypoint(command: Given, _driving: Driving) -> GoTo:
    hold = number(command, 1, "hold", low=0.0, high=MAX_WAIT, default=0.0)
    radius = number(command, 2, "acceptance radius", low=0.0, high=1000.0, default=0.0)
    yaw = heading_in(command, 4, turn=360.0)  # degrees; DO_REPOSITION's is in radians
    return GoTo(needed_place(command), None, radius or None, yaw and radians(yaw), hold)


def reposition_flags(command: Given) -> int:
    """Return the MAV_DO_REPOSITION_FLAGS of a "go to"."""
    return whole(command, 2, "flags", high=MAX_FLAGS)


def _reposition(command: Given, driving: Driving) -> GoTo:
    speed = None if command.params[0] == -1.0 else speed_or_default(command, 1, driving)
    radius = number(command, 3, "radius", low=-inf, high=1000.0, default=0.0)
    yaw = heading_in(command, 4, turn=tau)
    if yaw is not None and reposition_flags(command) & RELATIVE_YAW:
        raise bad("param2 relative yaw is not supported, give the heading from north", param=2)
    return GoTo(needed_place(command), speed, max(radius, 0.0) or None, yaw)


def _loiter_time(command: Given, _driving: Driving) -> Wait | GoTo:
    seconds = number(command, 1, "time", low=0.0, high=MAX_WAIT)
    here = tuple(command.params[4:6]) == (0.0, 0.0) or place_in(command) is None
    return Wait(seconds) if here else GoTo(needed_place(command), wait=seconds)


def _return(_command: Given, _driving: Driving) -> GoTo:
    return GoTo(None)


#: how its commands are read
PARSERS: Parsers = {
    MavCmd.NAV_WAYPOINT: _waypoint,
    MavCmd.DO_REPOSITION: _reposition,
    MavCmd.NAV_LOITER_TIME: _loiter_time,
    MavCmd.NAV_RETURN_TO_LAUNCH: _return,
}

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
