"""The composition root: starts a server from its settings, with links, store and runner."""

import asyncio
import gc
import json
import logging
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING, Any

from mav_tasks.basics.clock import boot_time
from mav_tasks.basics.errors import StoreError, UsageError
from mav_tasks.config.key_ring.ring_file import Loaded, load, path_of_ring
from mav_tasks.config.key_ring.watch import RingWatch
from mav_tasks.config.link_keys import check_keys, in_words
from mav_tasks.config.reload import Reload
from mav_tasks.config.settings import Links, Metrics, ServerSettings
from mav_tasks.engine.engine import Engine
from mav_tasks.kinds.in_json import PLUGGED
from mav_tasks.links.base import Link
from mav_tasks.links.config_check import faults_of, links_of, pushed_to, pushing_url
from mav_tasks.links.link_limits import TO_CLIENTS, TO_VEHICLES, LinkLimits
from mav_tasks.links.url import LinkUrl
from mav_tasks.recording import observers
from mav_tasks.recording.decisions import project_version
from mav_tasks.recording.observer import EngineObserver
from mav_tasks.shell.logs.field_notes import FieldNotes
from mav_tasks.shell.logs.setup import log_to_stderr
from mav_tasks.shell.logs.unreadable import Unreadable
from mav_tasks.shell.logs.vehicle_texts import VehicleTexts
from mav_tasks.shell.runner import EVICTED, Runner
from mav_tasks.store import Store
from mav_tasks.store.latest import note_latest
from mav_tasks.store.opening import kind_of, open_store
from mav_tasks.store.rendering import utc_text
from mav_tasks.tasks.restored import Restored

log = logging.getLogger("mav_tasks")

AGAIN = 1.0  # s between two attempts to reach the fleet's database

if TYPE_CHECKING:
    from mav_tasks.metrics.endpoint import Endpoint
    from mav_tasks.shell.gateway import Gateway


def serve(settings: ServerSettings, *, reload: Reload) -> int:
    """Run a server until a signal; return the exit code. Raise UsageError if it cannot start.

    SIGHUP reads the configuration again, by ``reload``.
    """
    code = _serve(settings, reload)
    while code == EVICTED:
        with log_to_stderr(settings.log):
            log.warning("gateway %s begins again, without rovers", settings.gateway.name)
        code = _serve_again(settings, reload)
    return code


def _serve_again(settings: ServerSettings, reload: Reload) -> int:
    """Serve once the fleet's database can be used: no fault of it ends a gateway that served."""
    from mav_tasks.shell.gateway import check_database  # noqa: PLC0415  # needs an extra

    _take_signals()
    told = ""
    while True:
        try:
            check_database(settings.store, settings.gateway.name)
            return _serve(settings, reload)
        except StoreError as error:
            if str(error) != told:
                told = str(error)
                with log_to_stderr(settings.log):
                    log.error("%s; trying again until it works", told)
        time.sleep(AGAIN)


def _serve(settings: ServerSettings, reload: Reload) -> int:
    """Run a server until a signal, or until its fleet has ended its lease (EVICTED)."""
    links = settings.links
    for _, fault in faults_of(links):
        raise fault
    asked, pushing = links_of(links), pushing_url(links)
    pushed = pushed_to(links)
    _take_signals()
    signal.signal(signal.SIGHUP, reload.note)
    say = partial(_say, as_json=settings.log.format == "json")
    with ExitStack() as opened:
        opened.enter_context(log_to_stderr(settings.log))
        metrics = _metrics(opened, settings.metrics)
        keys = _watched_ring(links)
        client_links: list[Link] = [
            _open(opened, link.url, TO_CLIENTS, push=pushed if link.url == pushing else ())
            for link in asked
            if link.side == "clients"
        ]
        vehicle_links = [
            _open(opened, link.url, TO_VEHICLES) for link in asked if link.side == "vehicles"
        ]
        gc.disable()  # many tasks are loaded: each collection would scan them
        gateway = _join(settings)
        if gateway is None:
            store = open_store(settings.store, settings.engine.retention)
        else:
            opened.callback(gateway.close)
            store = gateway.store
            client_links.append(gateway.link)
        opened.callback(store.close)
        note_latest(store.place)
        restored = store.load()
        if reload.file is not None:
            say(f"configuration {reload.file}")
        if keys.keys is not None:
            usable = sum(1 for key in keys.keys if key.secret)
            say(f"key ring {keys.path}, {usable} keys")
        for link in asked:
            signatures = in_words(link, has_ring=keys.keys is not None)
            waiting = "" if link.side == "clients" else ", waiting for the first heartbeat"
            say(f"{link.side} on {link.url}{signatures}{waiting}")
        for opened_link in vehicle_links:
            if opened_link.note:
                say(f"{opened_link.name}: {opened_link.note}")
        if pushed and pushing is None:
            say("links.push not used: no link for clients is UDP")
        if metrics is not None:
            say(f"metrics on http://{settings.metrics.listen}/metrics")
        if gateway is None:
            say(f"store {store.name}, {len(restored.tasks) if restored else 0} tasks")
        else:
            say(f"store {store.name}, as gateway {gateway.name} of its fleet")
        if restored is not None and restored.parameters:
            values = sorted(restored.parameters.items())
            told = ", ".join(f"{name} {value:g}" for name, value in values)
            say(f"parameters of an earlier run: {told}")
        if PLUGGED.broken:
            say(PLUGGED.broken)
        return _run(
            settings,
            store,
            restored,
            client_links,
            vehicle_links,
            reload,
            keys,
            say,
            metrics,
            gateway,
            opened.enter_context(asyncio.Runner()),
        )


def _join(settings: ServerSettings) -> "Gateway | None":
    """Join the fleet, if the settings name a gateway; raise StoreError."""
    if not settings.gateway.name:
        return None
    if not settings.store.startswith(("postgresql://", "postgres://")):
        raise UsageError(
            f"--gateway {settings.gateway.name} needs --store postgresql://USER@HOST/DATABASE:"
            " the gateways of a fleet share it"
        )
    kind_of(settings.store)  # explains a missing package
    from mav_tasks.shell.gateway import Gateway  # noqa: PLC0415  # needs an extra

    return Gateway(
        settings.store,
        settings.gateway,
        settings.engine.retention,
        system_id=settings.engine.identity.system_id,
    )


def _take_signals() -> None:
    """Let SIGINT and SIGTERM end this process at once, until the loop takes them over."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _leave_before_serving)


def _leave_before_serving(_number: int, _frame: object) -> None:
    """Exit at once: no vehicle is driven yet."""
    raise SystemExit(0)


def tame_collector() -> None:
    """Enable the cycle collector again, but avoid full collections.

    With 100,000 tasks a full collection takes a third of a second, in which no setpoint is sent.
    No long-lived object here is in a cycle; the few objects in cycles die young.
    """
    gc.freeze()
    gc.set_threshold(10_000, 20, 1_000_000)
    gc.enable()


def _watched_ring(links: Links) -> RingWatch:
    """Return a watch on the key ring; raise UsageError if the links need other keys.

    The default key ring may be missing: then there are no keys yet.
    """
    path = path_of_ring(links.keys)
    loaded: Loaded | None = None
    if links.keys or os.path.lexists(path):
        loaded = load(path)
    check_keys(links, None if loaded is None else loaded.ring, where=str(path))
    return RingWatch(path, loaded)


def _open(
    opened: ExitStack, url: LinkUrl, limits: LinkLimits, *, push: tuple[Any, ...] = ()
) -> Link:
    link = url.open(limits=limits, push=push)
    opened.callback(link.close)
    return link


def _metrics(opened: ExitStack, metrics: Metrics) -> "Endpoint | None":
    if not metrics.listen:
        return None
    from mav_tasks.metrics.endpoint import Endpoint  # noqa: PLC0415  # off by default

    endpoint = Endpoint(metrics.listen)
    opened.callback(endpoint.close)
    return endpoint


def _run(
    settings: ServerSettings,
    store: Store,
    restored: Restored | None,
    clients: Sequence[Link],
    vehicles: Sequence[Link],
    reload: Reload,
    keys: RingWatch,
    say: Callable[[str], None],
    metrics: "Endpoint | None",
    gateway: "Gateway | None",
    loops: asyncio.Runner,
) -> int:
    now = boot_time()
    engine = Engine(settings.engine, now=now, restored=restored)
    for why in engine.not_in_force:
        say(f"parameter of an earlier run ignored: {why}")
    recorders = observers(settings.recording, settings.engine, restored, now=now)
    for recorder in recorders:
        say(f"{recorder}")
    tame_collector()
    listeners: list[EngineObserver] = [VehicleTexts(), Unreadable(), *recorders]
    if logging.getLogger("mav_tasks").isEnabledFor(logging.DEBUG):
        listeners.append(FieldNotes(lambda: engine.snapshot(now=now).decoded))
    if metrics is not None:
        collector = metrics.show(
            engine.figures,
            clients=clients,
            vehicles=vehicles,
            recorders=recorders,
            restored=restored,
            version=project_version(),
            woke_at=lambda: runner.woke_at,
            loop=loops.get_loop(),
        )
        listeners.append(collector)
    runner = Runner(
        engine,
        store,
        clients=clients,
        vehicles=vehicles,
        reload=reload,
        observers=listeners,
        policies={str(link.url): link.policy for link in links_of(settings.links)},
        keys=keys,
        lease=gateway,
    )
    return runner.serve(loops)


def _say(words: str, *, as_json: bool) -> None:
    """Print a line for the person who started the server; a closed stdout is no error."""
    if sys.stdout is None:  # it was closed at start
        return
    line = f"mav-tasks: {words}"
    if as_json:  # stdout and stderr together must be JSON lines
        line = json.dumps({"time": utc_text(time.time()), "level": "info", "message": words})
    try:
        sys.stdout.write(f"{line}\n")
        sys.stdout.flush()
    except OSError:  # or the interpreter would fail to flush it at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
