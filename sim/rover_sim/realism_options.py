"""Command line options for a rover's start, its realism and its transmitter."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from math import isfinite, radians
from typing import NamedTuple

from rover_sim.body import wrap_angle
from rover_sim.geo import DEFAULT_ORIGIN, Origin
from rover_sim.personas import Persona
from rover_sim.realism import NO_BOOT, SHORT, Gps, Realism
from rover_sim.vehicle import Peers

HOME_FIELDS = 4
PULSES = (800, 2200)  # µs, the range of a receiver


class Place(NamedTuple):
    """Start of a rover, and the origin of its local frame."""

    origin: Origin
    yaw: float  # rad, clockwise from north


class StickPulses(NamedTuple):
    """The transmitter's pulses, µs."""

    throttle: int
    steering: int


def add_realism_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options for start, realism and transmitter."""
    add = parser.add_argument
    add(
        "--home",
        type=read_place,
        metavar="LAT,LON,ALT,HEADING",
        default=Place(DEFAULT_ORIGIN, 0.0),
        help="start position: degrees, metres above sea level, heading in degrees",
    )
    receivers = [each.value for each in Gps]
    add(
        "--gps",
        choices=receivers,
        default="fine",
        help="GPS accuracy: fine is centimetres, metre is 0.2 m of noise (default %(default)s)",
    )
    add(
        "--boot",
        choices=("short", "real", "none"),
        default="short",
        help="boot time until the rover can be armed; real: 23 s for ardupilot (default short, a"
        " twentieth of it)",
    )
    add(
        "--origin",
        choices=("told", "silent"),
        default="told",
        help="silent: never send GPS_GLOBAL_ORIGIN",
    )
    add(
        "--peers",
        choices=[each.value for each in Peers],
        help="clients to answer: all, or only the first one (default: first for px4, else all)",
    )
    add(
        "--sticks",
        type=read_sticks,
        metavar="THROTTLE[,STEERING]",
        help="simulate an RC transmitter that holds its sticks at these pulse widths, in"
        " microseconds (1500 is neutral)",
    )


def with_home_joined(arguments: Sequence[str]) -> list[str]:
    """Return the arguments with ``--home`` and its value joined by "=".

    argparse takes a value with a leading minus, such as a southern latitude, for an option.
    """
    joined: list[str] = []
    for each in arguments:
        if joined and joined[-1] == "--home":
            joined[-1] = f"--home={each}"
        else:
            joined.append(each)
    return joined


def realism_of(values: argparse.Namespace, persona: Persona) -> Realism:
    """Return the realism that the command line asks for."""
    boots = {"short": persona.boot.scaled(SHORT), "real": persona.boot, "none": NO_BOOT}
    return replace(
        persona.realism,
        boot=boots[values.boot],
        tells_origin=values.origin == "told",
        estimator=persona.estimators[Gps(values.gps)],
    )


def peers_of(values: argparse.Namespace, persona: Persona) -> Peers:
    """Return which peers the rovers answer."""
    if values.peers is not None:
        return Peers(values.peers)
    return Peers.FIRST if persona.answers_first_peer else Peers.ALL


def read_place(text: str) -> Place:
    """Parse ``--home``. Raise ArgumentTypeError."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != HOME_FIELDS or not all(isfinite(number) for number in numbers):
        raise argparse.ArgumentTypeError(f"must be LAT,LON,ALT,HEADING in numbers, not {text!r}")
    latitude, longitude, altitude, heading = numbers
    if not (abs(latitude) < 90.0 and abs(longitude) <= 180.0):  # at a pole there is no east
        raise argparse.ArgumentTypeError("latitude is within 90 degrees, longitude within 180")
    return Place(Origin(latitude, longitude, altitude), wrap_angle(radians(heading)))


def read_sticks(text: str) -> StickPulses:
    """Parse ``--sticks``. Raise ArgumentTypeError."""
    least, most = PULSES
    parts = text.split(",")
    if not 1 <= len(parts) <= len(StickPulses._fields) or not all(
        part.isdecimal() and least <= int(part) <= most for part in parts
    ):
        raise argparse.ArgumentTypeError(f"must be one or two pulses of {least} to {most}")
    return StickPulses(int(parts[0]), int(parts[1]) if len(parts) > 1 else 1500)
