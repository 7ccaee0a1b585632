"""``mav-tasks probe``: test one rover directly, without a server, and write its profile."""

import sys
from datetime import UTC, datetime
from typing import Annotated

import typer

from mav_tasks.basics.errors import ConfigError, NoAnswer, UsageError
from mav_tasks.cli import output as out
from mav_tasks.cli.command import command
from mav_tasks.cli.options import DEFAULT_SERVER, RingFile
from mav_tasks.cli.ring import key_to_sign_with
from mav_tasks.config import profiles
from mav_tasks.probe import report
from mav_tasks.probe.failsafe import NotSet
from mav_tasks.probe.probe import NothingHeard, Occupied, Options, Probe
from mav_tasks.probe.probing import run_probe
from mav_tasks.probe.profile import profile_of, why_none

QUESTION = """\
This arms the rover and drives it at up to {speed:g} m/s, within 1 m of its place, or 4 m and more
if its parameters say that it steers like a car. Is there room, is nobody near it, and can you stop
it manually? If this program is killed, only the rover's own time-out stops it.
Type "yes" to drive: """
SIGNALLED = 128  # as a shell reports a signal


@command
async def probe(
    url: Annotated[
        str | None,
        typer.Argument(
            metavar="URL",
            help="URL of the rover: udpout:host:port, udpin:host:port, tcp:host:port, "
            "serial:/dev/ttyUSB0:57600.",
        ),
    ] = None,
    set_failsafe: Annotated[
        bool,
        typer.Option(
            "--set-failsafe",
            help="Set the parameters that stop the rover when setpoints stop, and test nothing. "
            "URL may be that of a task server (default: the server on this machine).",
        ),
    ] = False,
    drive: Annotated[
        bool,
        typer.Option(
            "--drive",
            help="Arm the rover and drive it slowly, within 1 m of where it stands (4 m or more if "
            "it steers like a car).",
        ),
    ] = False,
    yes: Annotated[
        bool, typer.Option("--yes", "-y", help="With --drive: do not ask first.")
    ] = False,
    speed: Annotated[
        float,
        typer.Option(
            min=0.1,
            max=0.5,
            metavar="M/S",
            help="With --drive: speed from which to measure the stopping distance.",
        ),
    ] = 0.3,
    vehicle: Annotated[
        int | None,
        typer.Option(
            min=1, max=255, metavar="N", help="System id of the rover, if several are heard."
        ),
    ] = None,
    find_within: Annotated[
        float,
        typer.Option("--timeout", min=1.0, metavar="SECONDS", help="How long to wait for a rover."),
    ] = 10.0,
    output: Annotated[
        str | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="File for the profile; default: in the folder vehicles of your "
            "configuration folder.",
        ),
    ] = None,
    insecure: Annotated[
        bool,
        typer.Option("--insecure", help="Allow an unsigned link that other machines can reach."),
    ] = False,
    sign: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            envvar="MAV_TASKS_SIGN",
            help="Sign with this key, and accept only packets signed with it.",
        ),
    ] = "",
    keys: RingFile = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Test what a rover can do, without a server.

    Nothing moves and nothing stays changed unless you give --set-failsafe or --drive.
    """
    if set_failsafe and drive:
        raise UsageError("--set-failsafe and --drive: use one, then the other")
    if url is None and not set_failsafe:
        raise UsageError("the URL of the rover is missing: mav-tasks probe URL")
    if drive and not yes:
        _confirm(speed)
    key = key_to_sign_with(sign, keys) if sign else None
    options = Options(
        drive=drive,
        set_failsafe=set_failsafe,
        speed=speed,
        system_id=vehicle,
        find_within=find_within,
    )
    where = url or DEFAULT_SERVER
    done, signal = await run_probe(where, options, insecure=insecure, key=key, on_stage=out.warn)
    if isinstance(done.error, NothingHeard):
        raise NoAnswer(str(done.error))
    if isinstance(done.error, Occupied | NotSet):
        raise UsageError(str(done.error))
    if set_failsafe:
        _show_failsafe(done, as_json=as_json)
    else:
        _show(done, output, as_json=as_json)
    if signal:
        raise typer.Exit(SIGNALLED + signal)
    if done.findings.drive is not None and done.findings.drive.ended:
        raise typer.Exit(1)


def _confirm(speed: float) -> None:
    if not sys.stdin.isatty():
        raise UsageError("--drive moves the rover: without a terminal, add --yes")
    sys.stderr.write(QUESTION.format(speed=speed))
    sys.stderr.flush()
    if sys.stdin.readline().strip().lower() != "yes":
        raise UsageError("not driven: the answer was not yes")


def _show_failsafe(done: Probe, *, as_json: bool) -> None:
    """Print the parameters set, and what the rover does now when setpoints stop."""
    found = done.findings
    if as_json:
        out.say_json(report.as_json(found))
    else:
        out.say(f"rover {found.system_id}: {found.failsafe_set}; {found.loss_by_parameters}")


def _show(done: Probe, output: str | None, *, as_json: bool) -> None:
    """Write the profile and print the report. Raise ConfigError last if writing failed."""
    why, path, fault = why_none(done.findings), "", None
    if not why:
        try:
            path = _keep(done, output)
        except ConfigError as error:
            why, fault = str(error), error
    if as_json:
        values = report.as_json(done.findings)
        out.say_json(values | {"profile": path or None, "no_profile": why or None})
    else:
        from mav_tasks.cli.probe_table import table_of  # noqa: PLC0415

        out.show(table_of(report.lines_of(done.findings)))
        out.say(f"profile written to {path}" if path else f"no profile: {why}")
    if fault is not None:
        raise fault


def _keep(done: Probe, output: str | None) -> str:
    profile = profile_of(done.findings, probed=f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}")
    return str(profiles.write(profile, output))
