"""``python -m rover_sim.check_vehicle [URL]``: without a URL, of the simulated rovers."""

import asyncio
import sys
from collections import Counter
from typing import Annotated

import typer

from mav_tasks.basics.errors import UsageError
from mav_tasks.links.base import Link
from mav_tasks.links.link_limits import TO_VEHICLES
from mav_tasks.links.url import parse_url
from rover_sim.check_vehicle.contract import GROUPS, Check, Options, Seen, check_all
from rover_sim.check_vehicle.real import Verdict, compare
from rover_sim.check_vehicle.simulated import ROVERS, Make, in_its_world, measure
from rover_sim.observing.driver import Interference
from rover_sim.observing.observer import Observer
from rover_sim.observing.track import Track

OURS = (254, 190)  # not 255: an operator's failsafe may watch the heartbeats of 255
EVERYTHING = Options(arm=True, write=True)
BOOTED = 45.0  # s, until an ArduPilot uses its GPS


def main(
    url: Annotated[str, typer.Argument(help="URL of a rover; default: the simulated rovers.")] = "",
    only: Annotated[
        str, typer.Option(metavar="WORD", help="Only checks and figures of groups with this word.")
    ] = "",
    arm: Annotated[bool, typer.Option("--arm", help="Arm and disarm it, without moving.")] = False,
    write: Annotated[
        bool, typer.Option("--write", help="Upload plans, then restore the old ones.")
    ] = False,
    insecure: Annotated[
        bool, typer.Option("--insecure", help="Allow --arm beyond this machine.")
    ] = False,
    rover: Annotated[
        str,
        typer.Option(metavar="WORD", help=f"Simulated rovers with this word: {', '.join(ROVERS)}."),
    ] = "",
    brief: Annotated[bool, typer.Option("--brief", help="Only what is wrong.")] = False,
) -> None:
    """Check whether a rover behaves as the server and its clients expect.

    Without a URL: the simulated rovers, also beside recordings of the real ones, in virtual time.
    The exit status is 1 if a check fails or a figure differs.
    """
    groups = [group for group in GROUPS if only.lower() in group]
    makes = {name: make for name, make in ROVERS.items() if rover in name}
    try:
        if not makes:
            raise UsageError(f"--rover {rover}: there are {', '.join(ROVERS)}")
        if url and not groups:
            raise UsageError(f"--only {only}: groups are {', '.join(GROUPS)}")
        if url:
            link, options = _opened(url, insecure=insecure or not arm), Options(arm, write)
            bad = asyncio.run(_checked(link, options, groups, brief))
        else:
            bad = sum(_simulated(*each, only, groups, brief) for each in makes.items())
    except (UsageError, Interference) as error:
        sys.stderr.write(f"check_vehicle: {error}\n")
        raise typer.Exit(2) from None
    raise typer.Exit(bool(bad))


def _opened(url: str, *, insecure: bool) -> Link:
    parsed = parse_url(url)
    is_serial = url.startswith("serial:")
    if not insecure and (is_serial or not parsed.is_nearby):
        raise UsageError(f"{url} is beyond this machine: add --insecure to arm that rover")
    return parsed.open(limits=TO_VEHICLES)


async def _checked(link: Link, options: Options, groups: list[str], brief: bool) -> int:
    """Print a line for each check, what failed again at the end; return how many failed."""
    observer = Observer(link, source=OURS, keeps=True)
    lines: list[tuple[str, str]] = []
    try:
        async for check, seen in check_all(observer, options, groups):
            lines.append(line_of(check, seen))
            if not brief:
                _say(": ".join(lines[-1]))
    finally:
        observer.close()
    for outcome, line in lines:
        if outcome == "FAIL":
            _say(f"{outcome}: {line}")
    count = Counter(outcome for outcome, _ in lines)
    _say(f"{count['ok']} ok, {count['FAIL']} failed, {count['skipped']} skipped")
    return count["FAIL"]


def line_of(check: Check, seen: Seen) -> tuple[str, str]:
    """Return the outcome of a check, and its line."""
    outcome = "skipped" if seen.is_right is None else "ok" if seen.is_right else "FAIL"
    expected = f"expected {check.expected}; seen: " if outcome == "FAIL" else ""
    return outcome, f"{check.group}: {check.name}: {expected}{seen.words}"


def _simulated(name: str, make: Make, only: str, groups: list[str], brief: bool) -> int:
    """Check one simulated rover, and print its figures beside the real ones; count what is bad."""

    async def run(link: Link, _truth: Track) -> int:
        await asyncio.sleep(BOOTED)
        return await _checked(link, EVERYTHING, groups, brief)

    _say(f"{name}: simulated, beside {make.real}")
    bad = in_its_world(make, 0, run) if groups else 0
    count: Counter[Verdict] = Counter()
    for each in compare(name, measure(make, seed=0)):
        if only.lower() in each.group.lower():
            count[each.verdict] += 1
            if each.verdict is Verdict.DIFFERS or not brief:
                _say(str(each))
    _say(f"{name}: " + ", ".join(f"{count[each]} {each.value}" for each in Verdict))
    return bad + count[Verdict.DIFFERS]


def _say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    typer.run(main)
