"""``python -m rover_sim``: simulated rovers on one UDP socket, in real time or faster.

This file has the command line, the socket and the signals; the loop is in ``real_time``.
"""

import argparse
import signal
import socket
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from ipaddress import ip_address
from pathlib import Path
from typing import TextIO

from mav_tasks.basics.errors import KeyRingError
from mav_tasks.config.key_ring.ring_file import load, path_of_ring
from mav_tasks.mavlink.signing import Key
from rover_sim.body import Body, Pose
from rover_sim.bullet import NO_PYBULLET, BulletBody, has_pybullet
from rover_sim.errors import MissingExtra, SimulatedCrash
from rover_sim.fault_plan import HELP, PlanError, PlannedFault, check_rovers, read_fault
from rover_sim.fault_player import FaultPlayer, HandledRover
from rover_sim.frames import Frame
from rover_sim.kinematic_bodies import kinematic_body
from rover_sim.manual_control import BodyByHand
from rover_sim.personas import ARDUPILOT, PERSONAS, Persona
from rover_sim.real_time import Clock, drive
from rover_sim.realism import Realism
from rover_sim.realism_options import (
    Place,
    StickPulses,
    add_realism_arguments,
    peers_of,
    realism_of,
    with_home_joined,
)
from rover_sim.vehicle import Peers, make_vehicle

DEFAULT_PORT = 14580
SPACING = 3.0  # m between rovers, side by side
KINEMATIC_SLIP = 0.3  # as for the pybullet rover
TRUTH_HEADER = "time,system_id,north,east,yaw,forward_speed,yaw_rate\n"
USAGE_ERROR = 2  # exit status, as argparse's own
MAX_FRICTION = 5.0  # above that of rubber on any surface
ABORTED = 134  # a shell's status for SIGABRT, with which a crashing SITL ends


class StartError(Exception):
    """The simulator cannot start; the message is one line for the user."""


@dataclass(frozen=True, slots=True)
class Options:
    """The parsed command line."""

    host: str
    port: int
    insecure: bool
    count: int
    body: str  # "auto", "bullet" or "kinematic"
    persona: Persona
    system_id: int  # of the first rover
    seed: int | None
    friction: float
    variation: float
    gui: bool
    speed: float  # simulated seconds per second
    truth: str | None  # file name
    sign: str  # name of a key, "" for none
    keys: str  # file name of the key ring, "" for the user's own
    realism: Realism
    peers: Peers
    home: Place
    sticks: StickPulses | None  # None: no transmitter
    faults: tuple[PlannedFault, ...]
    shown_frame: str  # the --frame argument for the start-up line, "" if not given


def main(arguments: Sequence[str] | None = None) -> int:
    """Run until SIGINT or SIGTERM; return the exit status."""
    options = read_options(arguments)
    try:
        with ExitStack() as stack:
            run(options, stack)
    except (StartError, MissingExtra) as error:
        sys.stderr.write(f"rover_sim: {error}\n")
        return USAGE_ERROR
    except SimulatedCrash as error:
        sys.stderr.write(f"rover_sim: aborted, as the real one does: {error}\n")
        return ABORTED
    return 0


def read_options(arguments: Sequence[str] | None) -> Options:
    """Parse the command line; exit with status 2 on a usage error."""
    parser = argparse.ArgumentParser(
        prog="mav-tasks sim", description="Simulated rovers that speak MAVLink over UDP."
    )
    add = parser.add_argument
    add("--host", default="127.0.0.1", help="address to listen on (default %(default)s)")
    add(
        "--port",
        type=int,
        default=DEFAULT_PORT,
        help="UDP port; 0: any free one (default %(default)s)",
    )
    add("--insecure", action="store_true", help="allow an address other than loopback")
    add("--count", type=int, default=1, help="number of rovers, with consecutive system ids")
    add("--system-id", type=int, default=1, help="MAVLink system id of the first rover")
    bodies = ("auto", "bullet", "kinematic")
    add("--body", choices=bodies, default="auto", help="physics; auto is bullet if installed")
    add(
        "--persona",
        choices=tuple(PERSONAS),
        default=ARDUPILOT.name,
        help="autopilot to simulate (default %(default)s)",
    )
    add(
        "--honours-yaw-rate",
        action="store_true",
        help="let a px4 or generic rover follow yaw rates",
    )
    add("--seed", type=int, help="seed of the random errors and friction of each rover")
    add(
        "--friction",
        type=float,
        default=0.8,
        help="friction between tyres and ground (default %(default)s)",
    )
    add(
        "--friction-variation",
        type=float,
        default=0.0,
        help="random variation of the friction; 0.3: 30 %% (needs --seed)",
    )
    add("--gui", action="store_true", help="show the first rover in pybullet's window")
    add("--speed", default="real", help="'real', or simulated seconds per real second")
    add("--truth", metavar="FILE", help="append the true poses at 10 Hz as CSV")
    add(
        "--sign",
        metavar="NAME",
        default="",
        help="sign with this key, and accept only packets signed with it",
    )
    add(
        "--keys",
        metavar="FILE",
        default="",
        help="key ring file (default: keys.toml in your configuration folder)",
    )
    add(
        "--frame",
        choices=tuple(frame.value for frame in Frame),
        help="how the rover steers; skid and differential are the same (default: the persona's)",
    )
    add("--fault", metavar="TEXT", action="append", default=[], help=HELP)
    add_realism_arguments(parser)
    given = sys.argv[1:] if arguments is None else arguments
    values = parser.parse_args(with_home_joined(given))
    if values.count < 1:
        parser.error("--count must be 1 or more")
    if not 1 <= values.system_id <= 256 - values.count:
        parser.error("--system-id must leave the ids of all --count rovers within 1..255")
    if not 0.0 < values.friction <= MAX_FRICTION:
        parser.error(f"--friction must be above 0, at most {MAX_FRICTION:g}")
    if not 0.0 <= values.friction_variation < 1.0:
        parser.error("--friction-variation must be 0 or more, below 1")
    if values.friction_variation and values.seed is None:
        parser.error("--friction-variation needs --seed")
    if not 0 <= values.port <= 65535:
        parser.error("--port must lie within 0..65535")
    try:
        speed = 1.0 if values.speed == "real" else float(values.speed)
    except ValueError:
        speed = 0.0
    if not 0.0 < speed <= 1000.0:
        parser.error("--speed must be 'real' or a number above 0, at most 1000")
    persona = _persona(values.persona, honours_yaw_rate=values.honours_yaw_rate)
    if values.frame is not None:
        persona = persona.on(Frame(values.frame))
    last = values.system_id + values.count - 1
    try:
        faults = tuple(read_fault(text, persona.frame) for text in values.fault)
        check_rovers(faults, range(values.system_id, last + 1))
    except PlanError as error:
        parser.error(f"--fault: {error}")
    return Options(
        host=values.host,
        port=values.port,
        insecure=values.insecure,
        count=values.count,
        body=values.body,
        persona=persona,
        system_id=values.system_id,
        seed=values.seed,
        friction=values.friction,
        variation=values.friction_variation,
        gui=values.gui,
        speed=speed,
        truth=values.truth,
        sign=values.sign,
        keys=values.keys,
        realism=realism_of(values, persona),
        peers=peers_of(values, persona),
        home=values.home,
        sticks=values.sticks,
        faults=faults,
        shown_frame="" if values.frame is None else f", {values.frame}",
    )


def _persona(name: str, *, honours_yaw_rate: bool) -> Persona:
    persona = PERSONAS[name]
    return replace(persona, honours_yaw_rate=True) if honours_yaw_rate else persona


def run(options: Options, stack: ExitStack) -> None:
    """Set everything up, then run the rovers until SIGINT or SIGTERM."""
    options = _with_body(options)
    key = _key(options)
    stop = _stop_signals(stack)
    bodies = [_make_body(options, index, stack) for index in range(options.count)]
    server = _open_socket(options, stack)
    truth = _open_truth(options, stack)
    clock = Clock(options.speed)
    now = clock.now()  # one start time for all rovers, so that they wake up together
    vehicles = [
        make_vehicle(
            body,
            system_id=options.system_id + index,
            now=now,
            persona=options.persona,
            unix_offset=time.time() - now,
            key=key,
            origin=options.home.origin,
            realism=options.realism,
            seed=(options.seed or 0) + index,
            peers=options.peers,
        )
        for index, body in enumerate(bodies)
    ]
    if options.sticks is not None:
        for vehicle in vehicles:
            vehicle.autopilot.operator_pulses(*options.sticks)
    host, port = server.getsockname()[:2]
    for vehicle in vehicles:
        number = vehicle.autopilot.address.system_id
        where = f"udp {host}:{port}"
        what = f"{options.persona.name}, {options.body}{options.shown_frame}"
        sys.stdout.write(f"rover_sim: rover {number} ({what}) on {where}\n")
    sys.stdout.flush()
    rovers = [HandledRover(*each) for each in zip(vehicles, bodies, strict=True)]
    drive(server, stop, vehicles, clock, truth, FaultPlayer(options.faults, rovers))


def _with_body(options: Options) -> Options:
    """Replace body "auto": bullet if pybullet is installed or ``gui`` needs it, else kinematic."""
    if options.body != "auto":
        return options
    if options.gui or has_pybullet():
        return replace(options, body="bullet")
    sys.stderr.write(f"rover_sim: {NO_PYBULLET}\n")
    return replace(options, body="kinematic")


def _key(options: Options) -> Key | None:
    if not options.sign:
        return None
    path = path_of_ring(options.keys)
    try:
        return load(path).ring.usable_key(options.sign)
    except KeyRingError as error:
        raise StartError(f"--sign {options.sign}: {error}") from error


def _stop_signals(stack: ExitStack) -> socket.socket:
    """Return a socket that becomes readable on SIGINT and SIGTERM."""
    stop, wake = socket.socketpair()
    stack.enter_context(stop)
    stack.enter_context(wake)
    wake.setblocking(False)

    def wake_up(_number: int, _frame: object) -> None:
        try:
            wake.send(b"\0")
        except BlockingIOError:  # buffer full: the reader is already woken
            return

    for number in (signal.SIGINT, signal.SIGTERM):
        stack.callback(signal.signal, number, signal.signal(number, wake_up))
    return stop


def _open_socket(options: Options, stack: ExitStack) -> socket.socket:
    try:
        address = ip_address("127.0.0.1" if options.host == "localhost" else options.host)
    except ValueError as error:
        raise StartError(f"not an IP address: {options.host}") from error
    if not address.is_loopback and not (options.insecure or options.sign):
        raise StartError(
            f"{address} is not a loopback address and MAVLink here is not signed:"
            " use --sign NAME, or --insecure to allow that"
        )
    family = socket.AF_INET if address.version == 4 else socket.AF_INET6
    server = stack.enter_context(socket.socket(family, socket.SOCK_DGRAM))
    server.setblocking(False)
    try:
        server.bind((str(address), options.port))
    except OSError as error:
        raise StartError(f"udp {address}:{options.port}: {error.strerror}") from error
    return server


def _open_truth(options: Options, stack: ExitStack) -> TextIO | None:
    if options.truth is None:
        return None
    try:
        truth = stack.enter_context(Path(options.truth).open("a", encoding="ascii"))  # noqa: SIM115
    except OSError as error:
        raise StartError(f"{options.truth}: {error.strerror}") from error
    if truth.tell() == 0:
        truth.write(TRUTH_HEADER)
    return truth


def _make_body(options: Options, index: int, stack: ExitStack) -> BodyByHand:
    body = BodyByHand(_new_body(options, index), frame=options.persona.frame)
    stack.callback(body.close)
    return body


def _new_body(options: Options, index: int) -> Body:
    start = Pose(east=SPACING * index, yaw=options.home.yaw)
    seed = None if options.seed is None else options.seed + index
    if options.body == "kinematic":
        return kinematic_body(options.persona.frame, start=start, slip=KINEMATIC_SLIP, seed=seed)
    try:
        return BulletBody(
            start=start,
            frame=options.persona.frame,
            friction=options.friction,
            variation=options.variation,
            seed=seed,
            gui=options.gui and index == 0,
        )
    except MissingExtra as error:
        raise MissingExtra(f"{error}; or run with --body kinematic") from error


if __name__ == "__main__":
    sys.exit(main())
