"""``mav-tasks trial``: drive a rover through a table of requirements, and write a report."""

import asyncio
import shlex
import signal
import sys
from pathlib import Path
from shutil import which
from typing import Annotated

import typer

from mav_tasks.basics.errors import UsageError
from mav_tasks.cli import output as out
from mav_tasks.cli.command import command
from mav_tasks.cli.exit_codes import FAILED, INTERRUPTED
from mav_tasks.cli.lazy import completing
from rover_sim.trial.report import Report, why_no_picture
from rover_sim.trial.rows import ROOM, table
from rover_sim.trial.running import Options, run_trial
from rover_sim.trial.session import Limits, TrialError

DEFAULTS = Limits()
REPORT = Path("trial-report.md")


@command
async def trial(
    url: Annotated[
        str, typer.Argument(metavar="URL", help="URL of the rover, as for serve --vehicle.")
    ],
    only: Annotated[
        str,
        typer.Option(
            metavar="ROWS",
            help=f"Rows to drive, of {','.join(ROOM)}; default: all.",
            show_default=False,
        ),
    ] = ",".join(ROOM),
    yes: Annotated[
        bool, typer.Option("--yes", "-y", help="Do not ask whether there is room.")
    ] = False,
    report: Annotated[
        Path,
        typer.Option(metavar="FILE", help="File for the report; its picture has the suffix .png."),
    ] = REPORT,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an earlier report.")] = False,
    truth: Annotated[
        str,
        typer.Option(
            metavar="FILE|URL",
            help="True poses: a file of lines t,north,east,yaw, that of sim --truth, or a link "
            "with SIM_STATE or HIL_STATE_QUATERNION; default: the poses that the rover reports.",
        ),
    ] = "",
    stick: Annotated[
        str,
        typer.Option(
            metavar="URL",
            help="Second link to an ArduPilot, for RC_CHANNELS_OVERRIDE and a restart; default: "
            "the link of --truth, if there is one.",
        ),
    ] = "",
    reboot_command: Annotated[
        str, typer.Option(metavar="CMD", help="Command that restarts the rover's autopilot.")
    ] = "",
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            autocompletion=completing("mav_tasks.cli.config:assignments"),
            help="Set any key of the server's configuration; repeatable.",
        ),
    ] = None,
    stop_distance: Annotated[
        float | None,
        typer.Option(
            metavar="M",
            min=0.01,
            help="Shortest stopping distance from 1 m/s; default: measure it.",
        ),
    ] = None,
    end_error: Annotated[
        float, typer.Option(metavar="M", help="Limit of the end error that 95 % keep.")
    ] = DEFAULTS.end,
    turn_error: Annotated[
        float, typer.Option(metavar="DEG", help="Limit of the turn error that 95 % keep.")
    ] = DEFAULTS.turn,
    remainder: Annotated[
        float, typer.Option(metavar="M", help="Limit of the error after an interruption.")
    ] = DEFAULTS.remainder,
    stick_seconds: Annotated[
        float,
        typer.Option(metavar="S", help="Limit of the time from a moved stick to standstill."),
    ] = DEFAULTS.stick,
    keep: Annotated[
        str, typer.Option(metavar="FOLDER", help="Keep the server's store and log in this folder.")
    ] = "",
    insecure: Annotated[
        bool,
        typer.Option("--insecure", help="Allow an unsigned link that other machines can reach."),
    ] = False,
) -> None:
    """Drive a rover through a table of requirements, and write a report.

    Starts a server of its own, with default settings and a temporary store. The rover drives: it
    says how much room each row needs, and asks. Ctrl-C stops the rover. The exit status is 1 if a
    row failed.
    """
    rows = only.split(",")
    if unknown := [name for name in rows if name not in ROOM]:
        raise UsageError(f"--only {','.join(unknown)}: rows are {', '.join(ROOM)}")
    _check(keep, reboot_command)
    written = Report(report, url, set_ or ())
    written.check(may_replace=force)
    out.warn(why_no_picture())
    if not yes:
        _confirm(rows)
    options = Options(
        url,
        rows,
        truth=truth,
        stick=stick,
        reboot_command=reboot_command,
        stop_distance=stop_distance,
        limits=Limits(end=end_error, turn=turn_error, remainder=remainder, stick=stick_seconds),
        settings=set_ or (),
        insecure=insecure,
        keep=keep,
    )
    try:
        await _run(options, written)
    finally:
        if written.rows:
            out.say("\n".join(table(written.rows)))
            out.say(f"report: {report}")
    if written.has_failed:
        raise typer.Exit(FAILED)


def _check(keep: str, reboot_command: str) -> None:
    """Raise UsageError for what would fail once the rover drives."""
    if keep and Path(keep).is_dir() and any(Path(keep).iterdir()):
        raise UsageError(f"--keep {keep} is not empty: an earlier queue would be driven first")
    if reboot_command and which((shlex.split(reboot_command) or [""])[0]) is None:
        raise UsageError(f"--reboot-command {reboot_command}: there is no such program")


def _confirm(rows: list[str]) -> None:
    if sys.stdin is None or not sys.stdin.isatty():
        raise UsageError("the rover drives: without a terminal, add --yes")
    needs = "".join(f"  {name}: {ROOM[name]}\n" for name in rows)
    sys.stderr.write(
        f"This arms the rover and drives it at up to 1 m/s. It needs:\n{needs}Is all of this area"
        ' free of people and things, and can you stop the rover manually? Type "yes" to drive: '
    )
    sys.stderr.flush()
    if sys.stdin.readline().strip().lower() != "yes":
        raise UsageError("not driven: the answer was not yes")


async def _run(options: Options, report: Report) -> None:
    """Run the trial; the first signal ends it in order, with exit status 130."""
    running = asyncio.create_task(run_trial(options, report, say=out.say))
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        asyncio.get_running_loop().add_signal_handler(
            number, lambda: running.cancelling() or running.cancel()
        )
    try:
        await running
    except TrialError as error:
        raise UsageError(str(error)) from error
    except asyncio.CancelledError:
        out.warn("interrupted: the rover was told to stop")
        raise typer.Exit(INTERRUPTED) from None
