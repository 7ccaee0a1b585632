"""``python -m rover_sim.check_vehicle [URL]``: without a URL, of the simulated rovers."""

import asyncio
import sys
from typing import Annotated

import typer

from mav_tasks.basics.errors import UsageError
from mav_tasks.links.base import Link
from mav_tasks.links.link_limits import TO_VEHICLES
from mav_tasks.links.url import parse_url
from rover_sim.check_vehicle.contract import GROUPS, check_all
from rover_sim.check_vehicle.simulated import ROVERS, in_its_world, measure
from rover_sim.observing.driver import Interference
from rover_sim.observing.observer import Observer
from rover_sim.observing.track import Track

OURS = (254, 190)  # not 255: an operator's failsafe may watch the heartbeats of 255
BOOTED = 45.0  # s, until an ArduPilot uses its GPS


class Report:
    """Prints a line for each check and figure, and counts what is wrong."""

    failed = 0

    def note(self, name: str, value: object, expected: str, is_right: bool | None) -> None:
        """Print one; ``is_right`` None: it could not look."""
        self.failed += is_right is False
        outcome = "skipped" if is_right is None else "ok" if is_right else "FAIL"
        shown = f"{value:.3f}" if isinstance(value, float) else "–" if value is None else value
        self.say(f"{outcome}: {name}: {shown} ({expected})")

    @staticmethod
    def say(text: str) -> None:
        """Print a line."""
        sys.stdout.write(f"{text}\n")
        sys.stdout.flush()


def main(
    url: Annotated[str, typer.Argument(help="URL of a rover; default: the simulated rovers.")] = "",
    only: Annotated[
        str, typer.Option(metavar="WORD", help="Only checks and figures of groups with this word.")
    ] = "",
    arm: Annotated[bool, typer.Option("--arm", help="Arm and disarm it, without moving.")] = False,
    insecure: Annotated[
        bool, typer.Option("--insecure", help="Allow --arm beyond this machine.")
    ] = False,
    rover: Annotated[
        str,
        typer.Option(metavar="WORD", help=f"Simulated rovers with this word: {', '.join(ROVERS)}."),
    ] = "",
) -> None:
    """Check whether a rover behaves as the server and its clients expect.

    Without a URL: the simulated rovers, also beside recordings of the real ones, in virtual time.
    The exit status is 1 if a check fails or a figure differs.
    """
    groups = [group for group in GROUPS if only in group]
    names = [name for name in ROVERS if rover in name]
    report = Report()
    try:
        if not names:
            raise UsageError(f"--rover {rover}: there are {', '.join(ROVERS)}")
        if url and not groups:
            raise UsageError(f"--only {only}: groups are {', '.join(GROUPS)}")
        if url:
            link = _opened(url, insecure=insecure or not arm)
            asyncio.run(_check(link, report, groups, may_arm=arm))
        else:
            for name in names:
                _simulated(name, report, groups, only)
    except (UsageError, Interference) as error:
        sys.stderr.write(f"check_vehicle: {error}\n")
        raise typer.Exit(2) from None
    report.say(f"{report.failed} failed")
    raise typer.Exit(report.failed > 0)


def _opened(url: str, *, insecure: bool) -> Link:
    parsed = parse_url(url)
    is_serial = url.startswith("serial:")
    if not insecure and (is_serial or not parsed.is_nearby):
        raise UsageError(f"{url} is beyond this machine: add --insecure to arm that rover")
    return parsed.open(limits=TO_VEHICLES)


async def _check(link: Link, report: Report, groups: list[str], *, may_arm: bool) -> None:
    observer = Observer(link, source=OURS, keeps=True)
    try:
        async for check, value in check_all(observer, may_arm=may_arm, only=groups):
            expected = f"{check.expected}: {check.note}".removesuffix(": ")
            name = f"{check.group}: {check.name}"
            report.note(name, value, expected, check.is_right(value))
    finally:
        observer.close()


def _simulated(name: str, report: Report, groups: list[str], only: str) -> None:
    """Check one simulated rover, and print its figures beside the real ones."""

    async def run(link: Link, _truth: Track) -> None:
        await asyncio.sleep(BOOTED)
        await _check(link, report, groups, may_arm=True)

    report.say(f"{name}: simulated, beside {ROVERS[name].real}")
    if groups:
        in_its_world(ROVERS[name], 0, run)
    for row, value in measure(name, seed=0):
        if only in row.mark:
            expected = f"real: {row.real}: {row.why}".removesuffix(": ")
            report.note(row.name, value, expected, row.is_right(value))


if __name__ == "__main__":
    typer.run(main)
