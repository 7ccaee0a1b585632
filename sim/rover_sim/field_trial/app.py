"""Drive a rover with `mav-tasks serve` through a table of requirements, and print the results.

The server starts on a temporary store, with default settings. The rover DRIVES: give it room.
Ctrl-C stops the rover and ends the server. Exit status 0: each row that was tried passed;
1: one failed; 2: usage; 130: Ctrl-C.
"""

import argparse
import asyncio
import signal
import socket
import sys
import tempfile
from collections.abc import Sequence
from contextlib import AsyncExitStack, suppress
from functools import partial
from pathlib import Path

from mav_tasks.basics.errors import MavTasksError
from rover_sim.field_trial.ground import Limits
from rover_sim.field_trial.real_ground import RealGround
from rover_sim.field_trial.rows import Row, Verdict, table
from rover_sim.field_trial.rows_run import NAMES, run_rows
from rover_sim.field_trial.session import Session, TrialError, quietly
from rover_sim.field_trial.truth import FileTruth, LinkTruth

AREA = {
    "tasks": "36 m ahead and 16 m to each side of where it stands",
    "stop": "40 m ahead, or 20 m with --stop-distance",
}
OTHER_AREA = "10 m ahead"
DEFAULTS = Limits()
FAILED, USAGE, INTERRUPTED = 1, 2, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the trial; return the exit status."""
    parser = make_parser()
    options = parser.parse_args(arguments)
    only = tuple(options.only.split(",")) if options.only else NAMES
    unknown = [name for name in only if name not in NAMES]
    if unknown:
        parser.error(f"--only {','.join(unknown)}: rows are {', '.join(NAMES)}")
    say(f"rows: {', '.join(only)}. The rover drives; it needs:")
    for name in only:
        say(f"  {name}: {AREA.get(name, OTHER_AREA)}")
    if (
        not options.yes
        and input("Is all of this area free of people and things? [y/N] ").lower() != "y"
    ):
        return USAGE
    try:
        rows = asyncio.run(_interruptible(_trial(options, only)))
    except KeyboardInterrupt:
        say("interrupted: the rover was told to stop")
        return INTERRUPTED
    except (MavTasksError, TrialError, OSError) as error:
        say(f"field_trial: {error}")
        return USAGE
    say("")
    for line in table(rows):
        say(line)
    return FAILED if any(row.verdict is Verdict.FAIL for row in rows) else 0


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(
        prog="field_trial", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    add = parser.add_argument
    add("url", metavar="URL", help="URL of the rover, as for mav-tasks serve --vehicle")
    add(
        "--only",
        metavar="ROWS",
        default="",
        help=f"rows to drive, of {','.join(NAMES)}; default: all",
    )
    add("--yes", "-y", action="store_true", help="do not ask whether there is room")
    add(
        "--truth",
        metavar="FILE|URL",
        default="",
        help="true poses: a file of lines"
        " t,north,east,yaw or of JSON objects, or a link\nwith SIM_STATE or HIL_STATE_QUATERNION;"
        " default: the poses that the rover reports",
    )
    add(
        "--stick",
        metavar="URL",
        default="",
        help="second link to an ArduPilot, for"
        " RC_CHANNELS_OVERRIDE and a restart;\ndefault: the link of --truth, if there is one",
    )
    add(
        "--reboot-command",
        metavar="CMD",
        default="",
        help="command that restarts the rover's autopilot",
    )
    add(
        "--stop-distance",
        metavar="M",
        type=float,
        help="shortest stopping distance from 1 m/s; default: measure it",
    )
    add(
        "--end-error",
        metavar="M",
        type=float,
        default=DEFAULTS.end,
        help="limit of the p95 end error (default %(default)s)",
    )
    add(
        "--turn-error",
        metavar="DEG",
        type=float,
        default=DEFAULTS.turn,
        help="limit of the p95 turn error (default %(default)s)",
    )
    add(
        "--remainder",
        metavar="M",
        type=float,
        default=DEFAULTS.remainder,
        help="limit of the error after an interruption (default %(default)s)",
    )
    add(
        "--stick-seconds",
        metavar="S",
        type=float,
        default=DEFAULTS.stick,
        help="limit of the time from a moved stick to standstill (default %(default)s)",
    )
    add("--keep", metavar="FOLDER", default="", help="keep store and log in this folder")
    add(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="setting of the server; repeatable",
    )
    return parser


async def _trial(options: argparse.Namespace, only: Sequence[str]) -> Sequence[Row]:
    async with AsyncExitStack() as stack:
        folder = _folder(options.keep, stack)
        truth, second = None, None
        if ":" in options.truth:
            heard = LinkTruth(options.truth)
            stack.push_async_callback(heard.close)
            truth, second = heard.track, heard.endpoint
        elif options.truth:
            followed = FileTruth(Path(options.truth))
            stack.push_async_callback(followed.close)
            truth = followed.track
        if options.stick:
            another = LinkTruth(options.stick)
            stack.push_async_callback(another.close)
            second = another.endpoint
        settings = tuple(word for each in options.set for word in ("--set", each))
        ground = RealGround(
            options.url,
            folder=folder,
            port=_free_port(),
            truth=truth,
            second=second,
            reboot_command=options.reboot_command,
            options=settings,
        )
        stack.push_async_callback(ground.close)
        session = Session(
            ground,
            limits=Limits(
                end=options.end_error,
                turn=options.turn_error,
                stick=options.stick_seconds,
                remainder=options.remainder,
            ),
            say=say,
        )
        stack.push_async_callback(partial(_leave, session))
        if truth is not None:
            await session.until(lambda: len(truth) > 0, within=20.0, what="true poses")
        return await run_rows(session, only, stop_distance=options.stop_distance, done=_tell)


def _folder(keep: str, stack: AsyncExitStack) -> Path:
    folder = Path(keep or stack.enter_context(tempfile.TemporaryDirectory()))
    folder.mkdir(parents=True, exist_ok=True)
    return folder


async def _leave(session: Session) -> None:
    """Stop the rover, if there is a client, and end the server."""
    with suppress(TrialError):
        await quietly(lambda: session.client.stop(within=2.0))
    await session.end()


async def _interruptible(running: "asyncio.Future[Sequence[Row]] | object") -> Sequence[Row]:
    task: asyncio.Task[Sequence[Row]] = asyncio.ensure_future(running)  # type: ignore[arg-type]
    asyncio.get_running_loop().add_signal_handler(signal.SIGINT, task.cancel)
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, task.cancel)
    try:
        return await task
    except asyncio.CancelledError:
        raise KeyboardInterrupt from None


def _tell(row: Row) -> None:
    say(f"{row.name}: {row.verdict.value}: {row.result} {row.figure} (limit {row.limit})")


def say(text: str) -> None:
    """Print a line at once."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])
