"""Starts a server from what the command line says: settings, links, store, runner."""

import asyncio
import logging
import sys
from collections.abc import Sequence
from dataclasses import replace

from mav_tasks.engine.engine import Engine
from mav_tasks.errors import UsageError
from mav_tasks.links.udp import UdpLink
from mav_tasks.links.url import LinkUrl, parse_endpoint, parse_url, refuse_insecure
from mav_tasks.runner import Runner
from mav_tasks.settings import ARMING, Settings
from mav_tasks.store import MemoryStore


def serve(
    *,
    clients: Sequence[str],
    push: Sequence[str],
    vehicles: Sequence[str],
    arming: str,
    insecure: bool,
) -> int:
    """Run until a signal; gives the exit code. UsageError says what the operator can mend."""
    if arming not in ARMING:
        raise UsageError(f"--arming {arming}: expected one of {', '.join(ARMING)}")
    settings = replace(Settings(), arming=arming)
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
    # Pushing from the first client link: who answers is served from the socket it was called by.
    client_links = [
        UdpLink(url, push=pushed if number == 0 else ()) for number, url in enumerate(client_urls)
    ]
    vehicle_links = [UdpLink(url) for url in vehicle_urls]
    for link in client_links:
        sys.stdout.write(f"mav-tasks: clients on {link.name}\n")
    for link in vehicle_links:
        sys.stdout.write(f"mav-tasks: vehicles on {link.name}, waiting for the first heartbeat\n")
    sys.stdout.flush()
    return asyncio.run(_run(settings, client_links, vehicle_links))


async def _run(settings: Settings, clients: Sequence[UdpLink], vehicles: Sequence[UdpLink]) -> int:
    engine = Engine(settings, now=asyncio.get_running_loop().time())
    return await Runner(engine, MemoryStore(), clients=clients, vehicles=vehicles).run()


def _refuse_doubles(urls: Sequence[LinkUrl]) -> None:
    seen: set[LinkUrl] = set()
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
