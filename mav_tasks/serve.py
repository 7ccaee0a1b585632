"""Starts a server from what the command line says: settings, links, store, runner."""

import asyncio
import gc
import logging
import signal
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

from platformdirs import user_data_path

from mav_tasks.engine.engine import Engine
from mav_tasks.errors import StoreError, UsageError
from mav_tasks.links.base import Link
from mav_tasks.links.opening import open_link
from mav_tasks.links.url import LinkUrl, SerialUrl, parse_endpoint, parse_url, refuse_insecure
from mav_tasks.links.way_out import TO_CLIENTS, TO_VEHICLES, WayOut
from mav_tasks.runner import Runner
from mav_tasks.settings import ARMING, Retention, Settings
from mav_tasks.store import MemoryStore
from mav_tasks.store.sqlite import SqliteStore
from mav_tasks.tasks.restored import Restored

IN_MEMORY = ":memory:"
DEFAULT_STORE = "mav-tasks.sqlite3"


def serve(
    *,
    clients: Sequence[str],
    push: Sequence[str],
    vehicles: Sequence[str],
    arming: str,
    store: str | None,
    insecure: bool,
    keep_days: float,
    keep_tasks: int,
) -> int:
    """Run until a signal; gives the exit code. UsageError says what the operator can mend."""
    if arming not in ARMING:
        raise UsageError(f"--arming {arming}: expected one of {', '.join(ARMING)}")
    retention = Retention(max_age=keep_days * 86_400.0, max_count=keep_tasks)
    settings = replace(Settings(), arming=arming, retention=retention)
    client_urls = [parse_url(text) for text in clients]
    vehicle_urls = [parse_url(text) for text in vehicles]
    pushed = tuple(parse_endpoint(text, what=f"--push {text}") for text in push)
    _refuse_doubles(client_urls + vehicle_urls)
    if not insecure:
        for url in client_urls + vehicle_urls:
            refuse_insecure(url)
        for host, port in pushed:
            refuse_insecure(LinkUrl("udpout", host, port))
    log_to_stderr()
    for number in (signal.SIGINT, signal.SIGTERM):  # until the loop takes them over
        signal.signal(number, _leave_before_serving)
    with ExitStack() as opened:
        # Pushing from the first UDP link: who answers is served by the socket that called.
        pushing = next((url for url in client_urls if _is_udp(url)), None)
        client_links = [
            _open(opened, url, TO_CLIENTS, push=pushed if url is pushing else ())
            for url in client_urls
        ]
        vehicle_links = [_open(opened, url, TO_VEHICLES) for url in vehicle_urls]
        gc.disable()  # many tasks are read: it would look through them again and again
        journal = open_store(store, retention)
        opened.callback(journal.close)
        restored = journal.load() if isinstance(journal, SqliteStore) else None
        for link in client_links:
            _say(f"clients on {link.name}")
        if pushed and pushing is None:
            _say("nobody is spoken to unasked: none of the links for clients is UDP")
        for link in vehicle_links:
            _say(f"vehicles on {link.name}, waiting for the first heartbeat")
        _say(f"store {journal.name}, {len(restored.tasks) if restored else 0} tasks")
        if restored is not None and restored.parameters:
            _say(f"parameters set before: {_in_words(restored.parameters)}")
        sys.stdout.flush()
        return asyncio.run(_run(settings, journal, restored, client_links, vehicle_links))


def _leave_before_serving(_number: int, _frame: object) -> None:
    """Nothing is driven yet: an orderly end is simply to go."""
    raise SystemExit(0)


def tame_collector() -> None:
    """Let the cycle collector work again, but never look through everything that is kept.

    With 100,000 tasks that takes a third of a second, in which no setpoint leaves. Nothing here is
    kept in cycles; what little is made in some is young when it goes.
    """
    gc.freeze()
    gc.set_threshold(10_000, 20, 1_000_000)
    gc.enable()


def open_store(path: str | None, retention: Retention | None = None) -> SqliteStore | MemoryStore:
    """Open the store at a path; None: in the user's data folder. StoreError says why not."""
    if path == IN_MEMORY:
        return MemoryStore()
    if path == "":
        raise StoreError(f"--store: expected a path, or {IN_MEMORY}")
    chosen = Path(path) if path else user_data_path("mav-tasks", appauthor=False) / DEFAULT_STORE
    return SqliteStore(
        chosen, wall_offset=lambda: time.time() - time.monotonic(), retention=retention
    )


def _is_udp(url: LinkUrl | SerialUrl) -> bool:
    return isinstance(url, LinkUrl) and url.kind.startswith("udp")


def _open(
    opened: ExitStack, url: LinkUrl | SerialUrl, way: WayOut, *, push: tuple[Any, ...] = ()
) -> Link:
    link = open_link(url, way=way, push=push)
    opened.callback(link.close)
    return link


async def _run(
    settings: Settings,
    store: SqliteStore | MemoryStore,
    restored: Restored | None,
    clients: Sequence[Link],
    vehicles: Sequence[Link],
) -> int:
    now = asyncio.get_running_loop().time()
    engine = Engine(settings, now=now, restored=restored)  # what the store gave back
    for why in engine.not_in_force:
        _say(f"not in force, though set before: {why}")
    sys.stdout.flush()
    tame_collector()
    return await Runner(engine, store, clients=clients, vehicles=vehicles).run()


def _in_words(parameters: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value:g}" for name, value in sorted(parameters.items()))


def _say(words: str) -> None:
    sys.stdout.write(f"mav-tasks: {words}\n")


def _refuse_doubles(urls: Sequence[LinkUrl | SerialUrl]) -> None:
    seen: set[LinkUrl | SerialUrl] = set()
    for url in urls:
        if url in seen:
            raise UsageError(f"link {url} is given twice")
        seen.add(url)


def log_to_stderr() -> None:
    """Write the log where the operator sees it."""
    # Each event is one line, and under load there are thousands a second: what no line shows is
    # not looked up for it (logging's own manual, "Optimization").
    logging._srcfile = None
    logging.logThreads = logging.logProcesses = logging.logMultiprocessing = False
    logging.basicConfig(
        stream=sys.stderr,
        level=logging.INFO,
        format="%(asctime)s %(levelname)s %(message)s",
    )
