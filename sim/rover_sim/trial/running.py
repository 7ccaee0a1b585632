"""Runs the trial on a real rover, or on one that a simulator runs as a process."""

import asyncio
import tempfile
from collections.abc import Callable, Collection
from contextlib import AsyncExitStack, closing
from dataclasses import dataclass, field
from pathlib import Path

from pymavlink.dialects.v20 import development as mav

from mav_tasks.basics.errors import NoAnswer, UsageError
from mav_tasks.client.aio import Client
from mav_tasks.links.link_limits import TO_VEHICLES
from mav_tasks.links.policy import unsigned_beyond
from mav_tasks.links.url import parse_url
from rover_sim.observing.driver import Driver
from rover_sim.observing.observer import Observer
from rover_sim.observing.track import Track
from rover_sim.observing.truth import from_file, from_link
from rover_sim.testing.processes import free_ports
from rover_sim.trial.report import Report
from rover_sim.trial.rows import Row, run_rows
from rover_sim.trial.server import ServerProcess
from rover_sim.trial.session import Ground, Limits, Session

HEARD_WITHIN = 20.0  # s
TRUTH_WITHIN = 20.0  # s


@dataclass(frozen=True, slots=True)
class Options:
    """What is tried, on what."""

    url: str
    only: Collection[str]
    truth: str = ""  # a file, or a link to a simulator
    stick: str = ""  # a second link to an ArduPilot; "": that of ``truth``
    reboot_command: str = ""
    stop_distance: float | None = None
    limits: Limits = field(default_factory=Limits)
    settings: Collection[str] = ()
    insecure: bool = False
    keep: str = ""  # folder for store and log


async def run_trial(options: Options, report: Report, *, say: Callable[[str], None]) -> None:
    """Run the rows, add them to the report, and leave the rover standing, whatever happens.

    Raise UsageError for options that cannot be used, NoAnswer if no rover is heard.
    """
    parsed = parse_url(options.url)
    if not (options.insecure or parsed.is_nearby):
        raise unsigned_beyond(f"link {parsed}")
    async with AsyncExitStack() as stack:
        folder = Path(options.keep or stack.enter_context(tempfile.TemporaryDirectory()))
        await asyncio.to_thread(folder.mkdir, parents=True, exist_ok=True)
        truth, second = _truth(options, stack)
        report.rover = await _identify(options.url)
        say(f"rover: {report.rover}")
        (port,) = free_ports(1)
        server = ServerProcess(
            folder,
            *("--client", f"udpin:127.0.0.1:{port}", "--no-push", "--vehicle", options.url),
            *(word for each in options.settings for word in ("--set", each)),
            *(("--insecure",) if options.insecure else ()),
        )
        ground = Ground(
            server,
            lambda: Client(f"udpout:127.0.0.1:{port}"),
            lambda: parsed.open(limits=TO_VEHICLES),
            truth,
            second,
            options.reboot_command,
        )
        session = Session(ground, options.limits, say, best=options.stop_distance)

        def write() -> None:
            if report.rows:
                report.write(session.track, is_true=truth is not None)

        stack.callback(write)  # drawing takes seconds: the rover is stopped first
        stack.push_async_callback(session.end)
        if truth is not None:
            await session.until(lambda: len(truth) > 0, within=TRUTH_WITHIN, what="true poses")

        def done(row: Row) -> None:
            report.rows.append(row)
            say(f"{row.kind.title}: {row.verdict.value}: {row.result.words} {row.result.figure}")

        try:
            await run_rows(session, options.only, done=done)
        except BaseException as error:
            report.ended = str(error) or "interrupted"
            raise


def _truth(options: Options, stack: AsyncExitStack) -> tuple[Track | None, Observer | None]:
    """Return the source of true poses, and an observer on a second link, if they are there."""

    def observe(url: str) -> Observer:
        return stack.enter_context(closing(_observer(url)))

    truth, second = None, None
    if ":" in options.truth:
        second = observe(options.truth)
        truth = stack.enter_context(from_link(second))
    elif options.truth:
        try:
            truth = stack.enter_context(from_file(Path(options.truth)))
        except OSError as error:
            raise UsageError(f"--truth {options.truth}: {error.strerror}") from error
    return truth, observe(options.stick) if options.stick else second


def _observer(url: str) -> Observer:
    return Observer(parse_url(url).open(limits=TO_VEHICLES))


async def _identify(url: str) -> str:
    """Return make, system id and version of the rover. Raise NoAnswer if none is heard."""
    with closing(_observer(url)) as observer:
        if not await observer.found(HEARD_WITHIN):
            raise NoAnswer(f"no heartbeat of a rover from {url} within {HEARD_WITHIN:g} s")
        name = f"{Driver(observer).make.name}, system {observer.system}"
        wanted = mav.MAVLINK_MSG_ID_AUTOPILOT_VERSION
        await observer.command(mav.MAV_CMD_REQUEST_MESSAGE, wanted)
        version = observer.message("AUTOPILOT_VERSION")
        number = 0 if version is None else version.flight_sw_version
        shown = ".".join(str(number >> shift & 0xFF) for shift in (24, 16, 8))
        return f"{name}, firmware {shown if number else 'not reported'}"
