"""The command ``mav-tasks sim``: simulated rovers on one UDP socket, in real time or faster.

This file has the command line, the socket and the signals; the loop is in ``real_time``.
"""

import os
import signal
import socket
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import replace
from math import isfinite, nan, radians
from pathlib import Path
from typing import Annotated, Literal, NamedTuple, NoReturn, TextIO

import typer
from typer import BadParameter, Option

from mav_tasks.basics.errors import MavTasksError, UsageError
from mav_tasks.links.base import Link
from mav_tasks.links.link_limits import TO_CLIENTS
from mav_tasks.links.udp import UdpUrl
from mav_tasks.mavlink.signing import Key
from rover_sim.body import Pose, wrap_angle
from rover_sim.bullet import NO_PYBULLET, has_pybullet
from rover_sim.errors import MissingExtra, SimulatedCrash
from rover_sim.fault_plan import HELP, PlanError, PlannedFault, read_fault
from rover_sim.fault_player import FaultPlayer
from rover_sim.frames import Frame
from rover_sim.geo import DEFAULT_ORIGIN, Origin
from rover_sim.kinematic_bodies import make_body
from rover_sim.personas import PERSONAS, Persona
from rover_sim.real_time import Clock, drive
from rover_sim.realism import NO_BOOT, SHORT, Gps
from rover_sim.vehicle import Peers, make_vehicle

SPACING = 3.0  # m between rovers, side by side
TRUTH_HEADER = "time,system_id,north,east,yaw,forward_speed,yaw_rate\n"
HOME_FIELDS = 4
PULSES = (800, 2200)  # µs, the range of a receiver
USAGE_ERROR = 2  # exit status, as Typer's own
ABORTED = 134  # a shell's status for SIGABRT, with which a crashing SITL ends


class Place(NamedTuple):
    """Start of a rover, and the origin of its local frame."""

    origin: Origin = DEFAULT_ORIGIN
    yaw: float = 0.0  # rad, clockwise from north


class StickPulses(NamedTuple):
    """The transmitter's pulses, µs."""

    throttle: int
    steering: int = 1500


def read_place(text: str) -> Place:
    """Parse ``--home``. Raise BadParameter."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != HOME_FIELDS or not all(map(isfinite, numbers)):
        raise BadParameter(f"must be LAT,LON,ALT,HEADING in numbers, not {text!r}")
    latitude, longitude, altitude, heading = numbers
    if not (abs(latitude) < 90.0 and abs(longitude) <= 180.0):  # at a pole there is no east
        raise BadParameter("latitude is within 90 degrees, longitude within 180")
    return Place(Origin(latitude, longitude, altitude), wrap_angle(radians(heading)))


def read_sticks(text: str) -> StickPulses:
    """Parse ``--sticks``. Raise BadParameter."""
    least, most = PULSES
    parts = text.split(",")
    if not 1 <= len(parts) <= len(StickPulses._fields) or not all(
        part.isdecimal() and least <= int(part) <= most for part in parts
    ):
        raise BadParameter(f"must be one or two pulses of {least} to {most}")
    return StickPulses(*map(int, parts))


def between(least: float, most: float) -> Callable[[str | float], float]:
    """Return a parser of a number within these; "real" is 1. It raises BadParameter."""

    def read(given: str | float) -> float:
        value = nan
        with suppress(ValueError):
            value = float("1" if given == "real" else given)
        if not least <= value <= most:  # NaN never is
            raise BadParameter(f"must be {least:g} to {most:g}, not {given!r}")
        return value

    return read


def sim(
    host: Annotated[str, Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, Option(min=0, max=65535, help="UDP port; 0: any free one.")] = 14580,
    insecure: Annotated[
        bool, Option("--insecure", help="Allow an address other than loopback.")
    ] = False,
    count: Annotated[int, Option(min=1, help="Number of rovers, with consecutive system ids.")] = 1,
    system_id: Annotated[
        int, Option(min=1, max=255, help="MAVLink system id of the first rover.")
    ] = 1,
    body: Annotated[
        Literal["auto", "bullet", "kinematic"], Option(help="Physics; auto: bullet if installed.")
    ] = "auto",
    persona: Annotated[
        Literal["ardupilot", "px4", "generic"], Option(help="Autopilot to simulate.")
    ] = "ardupilot",
    honours_yaw_rate: Annotated[
        bool,
        Option("--honours-yaw-rate", help="Let a px4 or generic rover follow yaw rates."),
    ] = False,
    frame: Annotated[
        Frame | None,
        Option(help="How it steers; skid and differential are the same; default: the persona's."),
    ] = None,
    seed: Annotated[
        int | None, Option(help="Seed of the random errors and friction of each rover.")
    ] = None,
    friction: Annotated[
        float,
        Option(
            parser=between(0.01, 5.0), metavar="NUMBER", help="Friction between tyres and ground."
        ),
    ] = 0.8,
    friction_variation: Annotated[
        float,
        Option(
            parser=between(0.0, 0.99),
            metavar="NUMBER",
            help="Random variation of the friction: 0.3 for 30 %; needs --seed.",
        ),
    ] = 0.0,
    gui: Annotated[
        bool, Option("--gui", help="Show the first rover in pybullet's window.")
    ] = False,
    speed: Annotated[
        float,
        Option(
            parser=between(0.01, 1000.0),
            metavar="real|NUMBER",
            show_default="real",
            help="Simulated seconds per real second.",
        ),
    ] = 1.0,
    truth: Annotated[
        str | None, Option(metavar="FILE", help="Append the true poses at 10 Hz as CSV.")
    ] = None,
    sign: Annotated[
        str,
        Option(metavar="NAME", help="Sign with this key, and accept only packets signed with it."),
    ] = "",
    keys: Annotated[
        str,
        Option(
            metavar="FILE",
            help="Key ring file; default: keys.toml in your configuration folder.",
        ),
    ] = "",
    fault: Annotated[list[str] | None, Option(metavar="TEXT", help=HELP)] = None,
    home: Annotated[
        Place | None,
        Option(
            parser=read_place,
            metavar="LAT,LON,ALT,HEADING",
            help="Start position: degrees, metres above sea level, heading in degrees.",
        ),
    ] = None,
    gps: Annotated[
        Gps, Option(help="GPS accuracy; fine: centimetres; metre: 0.2 m of noise.")
    ] = Gps.FINE,
    boot: Annotated[
        Literal["short", "real", "none"],
        Option(
            help="Boot time until the rover can be armed; real: 23 s for ardupilot; short: a"
            " twentieth of it."
        ),
    ] = "short",
    origin: Annotated[
        Literal["told", "silent"], Option(help="silent: never send GPS_GLOBAL_ORIGIN.")
    ] = "told",
    peers: Annotated[
        Peers | None,
        Option(help="Clients to answer: all, or only the first; default: first for px4, else all."),
    ] = None,
    sticks: Annotated[
        StickPulses | None,
        Option(
            parser=read_sticks,
            metavar="THROTTLE[,STEERING]",
            help="Simulate an RC transmitter that holds its sticks at these pulse widths, in"
            " microseconds (1500 is neutral).",
        ),
    ] = None,
) -> None:
    """Run simulated rovers on UDP 14580."""
    numbers = range(system_id, system_id + count)
    if numbers[-1] > 255:
        _refuse("--system-id", "must leave the ids of all --count rovers within 1..255")
    if friction_variation and seed is None:
        _refuse("--friction-variation", "needs --seed")
    make = PERSONAS[persona]
    if frame is not None:
        make = make.on(frame)
    if honours_yaw_rate:
        make = replace(make, honours_yaw_rate=True)
    realism = replace(
        make.realism,
        boot={"short": make.boot.scaled(SHORT), "real": make.boot, "none": NO_BOOT}[boot],
        tells_origin=origin == "told",
        estimator=make.estimators[gps],
    )
    place = home or Place()
    answers = peers or (Peers.FIRST if make.answers_first_peer else Peers.ALL)
    faults = _plan(fault or [], make, numbers)

    try:
        with ExitStack() as stack:
            if body == "auto":
                body = "bullet" if gui or has_pybullet() else "kinematic"
                if body == "kinematic":
                    sys.stderr.write(f"rover_sim: {NO_PYBULLET}\n")
            key = _key(sign, keys) if sign else None
            _end_on_signals(stack)
            bodies = [
                make_body(
                    body,
                    make.frame,
                    start=Pose(east=SPACING * index, yaw=place.yaw),
                    seed=None if seed is None else seed + index,
                    friction=friction,
                    variation=friction_variation,
                    gui=gui and index == 0,
                )
                for index in range(count)
            ]
            for each in bodies:
                stack.callback(each.close)
            link = _open_link(host, port, is_allowed=insecure or key is not None)
            stack.callback(link.close)
            poses = None if truth is None else _open_truth(truth, stack)
            clock = Clock(speed)
            now = clock.now()  # one start time for all rovers, so that they wake up together
            rovers = [
                make_vehicle(
                    each,
                    system_id=number,
                    now=now,
                    persona=make,
                    unix_offset=time.time() - now,
                    key=key,
                    origin=place.origin,
                    realism=realism,
                    seed=(seed or 0) + index,
                    peers=answers,
                )
                for index, (number, each) in enumerate(zip(numbers, bodies, strict=True))
            ]
            with socket.socket(fileno=os.dup(link.fileno())) as opened:
                where = "{}:{}".format(*opened.getsockname()[:2])
            what = ", ".join([persona, body, *([] if frame is None else [frame.value])])
            for number, rover in zip(numbers, rovers, strict=True):
                if sticks is not None:
                    rover.autopilot.operator_pulses(*sticks)
                sys.stdout.write(f"rover_sim: rover {number} ({what}) on udp {where}\n")
            sys.stdout.flush()
            drive(link, rovers, clock, poses, FaultPlayer(faults, rovers))
    except (MavTasksError, MissingExtra, OSError) as error:
        sys.stderr.write(f"rover_sim: {error}\n")
        raise typer.Exit(USAGE_ERROR) from None
    except KeyboardInterrupt:
        return
    except SimulatedCrash as error:
        sys.stderr.write(f"rover_sim: aborted, as the real one does: {error}\n")
        raise typer.Exit(ABORTED) from None


def _refuse(option: str, why: str) -> NoReturn:
    raise BadParameter(why, param_hint=f"'{option}'")


def _plan(texts: list[str], make: Persona, numbers: range) -> list[PlannedFault]:
    try:
        return [read_fault(text, make.frame, numbers) for text in texts]
    except PlanError as error:
        _refuse("--fault", str(error))


def _key(name: str, ring_file: str) -> Key:
    from mav_tasks.config.key_ring.ring_file import load, path_of_ring  # noqa: PLC0415  # slow

    return load(path_of_ring(ring_file)).ring.usable_key(name)


def _end_on_signals(stack: ExitStack) -> None:
    """Let the first SIGINT or SIGTERM raise KeyboardInterrupt, and ignore more of them."""
    signals = (signal.SIGINT, signal.SIGTERM)

    def end(*_: object) -> None:
        for number in signals:
            signal.signal(number, signal.SIG_IGN)
        raise KeyboardInterrupt

    for number in signals:
        stack.callback(signal.signal, number, signal.signal(number, end))


def _open_link(host: str, port: int, *, is_allowed: bool) -> Link:
    url = UdpUrl("udpin", host, port)
    if not url.is_nearby and not is_allowed:
        raise UsageError(
            f"{host} is not a loopback address and MAVLink here is not signed:"
            " use --sign NAME, or --insecure to allow that"
        )
    return url.open(limits=TO_CLIENTS)


def _open_truth(name: str, stack: ExitStack) -> TextIO:
    truth = stack.enter_context(Path(name).open("a", encoding="ascii"))  # noqa: SIM115
    if truth.tell() == 0:
        truth.write(TRUTH_HEADER)
    return truth
