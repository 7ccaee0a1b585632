"""``python -m rover_sim.check_vehicle URL``: check whether a vehicle behaves as expected.

This file has the command line, the link and the signals; ``contract`` lists the checks.
"""

import argparse
import json
import signal
import sys
from collections.abc import Sequence

from rover_sim.check_vehicle.context import Options
from rover_sim.check_vehicle.contract import GROUPS, NothingHeard, check_vehicle
from rover_sim.check_vehicle.conventions import WAYS
from rover_sim.check_vehicle.report import Line
from rover_sim.check_vehicle.wire import BadUrl, MavutilWire, Url, read_url

PASSED, FAILED, USAGE_ERROR, INTERRUPTED = 0, 1, 2, 130
ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the checks; return the exit status: 0 passed, 1 failed, 2 usage or no vehicle."""
    parser = make_parser()
    values = parser.parse_args(arguments)
    try:
        url = read_url(values.url)
    except BadUrl as error:
        parser.error(str(error))
    if not 0.0 < values.speed <= 100.0:
        parser.error("--speed must be above 0, at most 100")
    if values.system_id is not None and not 1 <= values.system_id <= 255:
        parser.error("--system-id must lie within 1..255")
    if unknown := set(values.only) - set(GROUPS):
        parser.error(f"--only {' '.join(unknown)}: expected {', '.join(GROUPS)}")
    if (values.arm or values.drive) and not url.is_local and not values.insecure:
        parser.error(f"{values.url} is beyond this machine: add --insecure to arm that vehicle")
    for number in ENDING:
        signal.signal(number, _interrupt_once)
    return _run(url, values)


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(
        prog="rover_sim.check_vehicle",
        description="Check whether a MAVLink rover behaves as a task server and its clients expect."
        " Nothing moves and nothing stays changed unless you give --arm, --drive or --write.",
    )
    add = parser.add_argument
    add("url", help="udpout:127.0.0.1:14580, udpin:…, tcp:…, tcpin:… or serial:/dev/ttyACM0:57600")
    add(
        "--persona",
        choices=("auto", *WAYS),
        default="auto",
        help="autopilot to expect (default: the one that it reports)",
    )
    add("--arm", action="store_true", help="arm and disarm the vehicle without moving it")
    add(
        "--drive", action="store_true", help="arm the vehicle and drive some metres: keep 20 m free"
    )
    add(
        "--write", action="store_true", help="upload missions and fences, then restore the old ones"
    )
    add(
        "--insecure",
        action="store_true",
        help="allow --arm and --drive for a vehicle that is not on this machine",
    )
    add("--system-id", type=int, help="system id of the vehicle, if there are several")
    add(
        "--only",
        nargs="+",
        default=list(GROUPS),
        metavar="GROUP",
        help=f"groups of checks: {', '.join(GROUPS)}",
    )
    add(
        "--speed",
        type=float,
        default=1.0,
        help="simulated seconds per real second of a simulated vehicle",
    )
    add("--json", action="store_true", help="print a JSON list at the end instead of lines")
    return parser


def _run(url: Url, values: argparse.Namespace) -> int:
    options = Options(
        arm=values.arm, drive=values.drive, write=values.write, persona=values.persona
    )
    show = _silent if values.json else _show
    try:
        wire = MavutilWire(url, speed=values.speed)
    except Exception as error:  # noqa: BLE001 - pymavlink's links raise what they like
        return _complain(f"{values.url}: {error}")
    try:
        report = check_vehicle(
            wire, options, system_id=values.system_id, show=show, groups=tuple(values.only)
        )
    except NothingHeard as error:
        return _complain(str(error))
    except KeyboardInterrupt:
        sys.stderr.write("check_vehicle: interrupted\n")
        return INTERRUPTED
    finally:
        wire.close()
    if values.json:
        sys.stdout.write(json.dumps(report.as_json(), indent=1) + "\n")
    else:
        for line in report.failed:
            sys.stdout.write(f"{line}\n")
        sys.stdout.write(f"{report.summary()}\n")
    return FAILED if report.failed else PASSED


def _interrupt_once(_number: int, _frame: object) -> None:
    """Raise KeyboardInterrupt, which brings the vehicle to rest; ignore further signals."""
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)
    raise KeyboardInterrupt


def _show(line: Line) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def _silent(_line: Line) -> None:
    """Print nothing: the JSON list comes at the end."""


def _complain(text: str) -> int:
    sys.stderr.write(f"check_vehicle: {text}\n")
    return USAGE_ERROR


if __name__ == "__main__":
    sys.exit(main())
