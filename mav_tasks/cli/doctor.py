"""``mav-tasks doctor``: look for what is wrong, and say what helps."""

import os
import shutil
import stat
from collections.abc import AsyncIterator, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from mav_tasks.basics.errors import ClientError, StoreError, UsageError
from mav_tasks.cli import output, words
from mav_tasks.cli.command import command
from mav_tasks.cli.exit_codes import FAILED
from mav_tasks.cli.options import Common
from mav_tasks.cli.session import NO_ROVER, opened
from mav_tasks.client.aio import Client
from mav_tasks.client.descriptions import why_of
from mav_tasks.client.telemetry import all_show
from mav_tasks.config.configuration import Sources
from mav_tasks.config.key_ring.ring_file import load, path_of_ring
from mav_tasks.config.link_keys import check_keys
from mav_tasks.config.settings import Links, ServerSettings
from mav_tasks.links.config_check import ConfiguredLink, links_of
from mav_tasks.links.link_limits import TO_CLIENTS, TO_VEHICLES
from mav_tasks.store.latest import latest_store
from mav_tasks.store.opening import kind_of
from mav_tasks.store.sqlite import path_of
from mav_tasks.tasks.lifecycle import words_of

WITHIN = 3.0  # s to wait for a server
LEAST_ROOM = 100_000_000  # bytes free on the disk of the store
SERVE = "start one: mav-tasks serve"
OTHERS = stat.S_IRWXG | stat.S_IRWXO


class Finding(NamedTuple):
    """What one look has found; ``help`` is what a person can do, "" if nothing is wrong."""

    about: str
    words: str
    help: str = ""


@command
async def doctor(
    common: Common,
    config: Annotated[
        str | None,
        typer.Option(
            metavar="FILE", help="Configuration file; default: the file that serve would read."
        ),
    ] = None,
) -> None:
    """Look for what is wrong, from the settings to the rovers.

    Changes nothing, and sends rovers nothing. Exit status 0: nothing is wrong; 1: something is.
    """
    findings: list[Finding] = []
    try:
        settings = Sources(config, dict(os.environ)).load().settings
    except UsageError as error:
        findings.append(Finding("settings", str(error), "correct it; serve would not start"))
        settings = ServerSettings()
    else:
        findings.append(Finding("settings", "valid"))
    rovers = [each async for each in _server_and_rovers(common)]
    is_served = rovers[0].help != SERVE
    findings += [
        _keys(settings.links),
        *_store(settings.store or (is_served and latest_store()) or ""),
    ]
    findings += [] if is_served else list(_links(settings.links))
    findings += rovers
    for each in findings:
        _show(each, as_json=common.json)
    if any(each.help for each in findings):
        raise typer.Exit(FAILED)


def _show(finding: Finding, *, as_json: bool) -> None:
    if as_json:
        output.say_json(finding._asdict() | {"ok": not finding.help})
        return
    mark = "WRONG" if finding.help else "ok"
    helps = f": {finding.help}" if finding.help else ""
    output.say(f"{mark:<7}{finding.about:<10}{finding.words}{helps}")


def _keys(links: Links) -> Finding:
    path = path_of_ring(links.keys)
    try:
        ring = load(path).ring if links.keys or os.path.lexists(path) else None
        check_keys(links, ring, where=str(path))
    except UsageError as error:
        return Finding("keys", str(error), "mav-tasks keys list")
    if ring is None:
        return Finding("keys", "no key ring: programs of this machine need no key")
    names = [each.name for each in ring.entries if each.is_usable]
    return Finding("keys", f"{path}: {', '.join(names) or 'no usable key'}")


def _store(place: str) -> Iterator[Finding]:
    try:
        kind_of(place)
    except StoreError as error:
        yield Finding("store", str(error), "choose another with --store")
        return
    if ":" in place:
        yield Finding("store", "not a file: the server looks at it when it starts")
        return
    path = path_of(place).expanduser().absolute()
    folder = next(each for each in path.parents if each.exists())
    if not os.access(folder, os.W_OK | os.X_OK) or (path.exists() and not os.access(path, os.W_OK)):
        yield Finding("store", f"{path}: this user may not write it", f"chown or chmod {folder}")
    elif path.exists() and path.stat().st_mode & OTHERS:
        yield Finding("store", f"{path}: other users can read it", f"chmod 600 {path}")
    else:
        yield Finding("store", f"{path}{'' if path.exists() else ' (serve will create it)'}")
    if shutil.disk_usage(folder).free < LEAST_ROOM:
        yield Finding("disk", f"{folder}: less than 100 MB free", "make room, or move the store")


def _links(links: Links) -> Iterator[Finding]:
    """Try whether each link can be opened. While a server has them, nobody else can."""
    for link in links_of(links):
        yield _link(link)


def _link(link: ConfiguredLink) -> Finding:
    about = link.side
    if str(link.url).startswith("serial:"):
        device = Path(str(link.url).split(":")[1])
        if not device.exists():
            return Finding(about, f"{link.url}: no such device", "plug it in; 'dmesg' names it")
        if not os.access(device, os.R_OK | os.W_OK):
            helps = "sudo usermod -aG dialout $USER, then log in again"
            return Finding(about, f"{link.url}: this user may not open it", helps)
    try:
        link.url.open(limits=TO_CLIENTS if about == "clients" else TO_VEHICLES).close()
    except UsageError as error:
        return Finding(about, str(error), "end the other program, or choose another link")
    return Finding(about, f"{link.url} can be opened")


async def _server_and_rovers(common: Common) -> AsyncIterator[Finding]:
    try:
        async with opened(replace(common, timeout=min(common.timeout, WITHIN))) as client:
            await all_show(client, lambda each: each.is_heard)
            yield Finding("server", f"answers on {common.server}")
            for rover in client.vehicles():
                yield await _rover(client, rover.id, is_heard=rover.is_heard)
    except ClientError as error:
        helps = "switch the rover on; see serve --vehicle" if NO_ROVER in str(error) else SERVE
        yield Finding("server", str(error), helps)


async def _rover(client: Client, rover: int, *, is_heard: bool) -> Finding:
    about = f"rover {rover}"
    with suppress(ClientError):
        queue = await client.queue(vehicle=rover, limit=1)
        silence = words.silence_of(queue.heartbeat_age)
        if silence or not is_heard:
            helps = "check its power, radio and --vehicle; mav-tasks probe URL, without the server"
            return Finding(about, silence or "silent", helps)
        alone = len(client.vehicles()) == 1
        if queue.paused is not None:
            helps = words.way_to_resume(queue, queue.paused, is_alone=alone)
            return Finding(about, f"queue paused ({words_of(queue.paused)})", helps)
        if (stuck := words.blocked(queue)) is not None:
            helps = words.way_on_of(stuck, is_alone=alone)
            return Finding(about, f"task {stuck.id} waits ({why_of(stuck)})", helps)
        return Finding(about, "heard, and its queue runs")
    return Finding(about, "its queue was not answered", "try again")
