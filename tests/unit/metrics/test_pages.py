"""The pages of the metrics, by HTTP: who is ready, the figures, and what cannot be shown."""

import asyncio
from dataclasses import replace

import pytest

from mav_tasks.basics.errors import UsageError
from mav_tasks.engine.inputs import (
    AtOnce,
    Committed,
    HaltNotStored,
    LinkSide,
    Outgoing,
    Packets,
    PeerChanged,
    Shutdown,
    StoreFailed,
)
from mav_tasks.links.link_limits import TO_VEHICLES
from mav_tasks.links.url import parse_url
from mav_tasks.metrics.collector import Collector
from mav_tasks.metrics.families import TASKS
from mav_tasks.metrics.http_server import Answer, HttpServer, Page, listening
from mav_tasks.metrics.pages import Pages
from mav_tasks.tasks.events import QueueContinued, TaskChanged, TaskModified, TaskSubmitted
from mav_tasks.tasks.restored import Restored
from tests.kit.awaited import awaited
from tests.kit.processes import free_tcp_ports
from tests.kit.rows import check
from tests.kit.scraped import asked
from tests.kit.world import World

LATER = """
TASK_MOVE 1 0 0 0 0 1 & wait 2 : ACCEPTED
mission; GO; GO at=1,0 : ACCEPTED
DO_PAUSE_CONTINUE 0 : ACCEPTED
"""
LINES = """mav_tasks_halts_not_stored_total{vehicle="1"} 1
mav_tasks_link_bytes_total{link="gcs",direction="received"} 10
mav_tasks_queue_length{vehicle="1"} 3
mav_tasks_store_writable 1
mav_tasks_tasks{vehicle="1",state="blocked",reason="waiting_for_start"} 2
mav_tasks_task_interruptions_total{vehicle="1",state="paused",reason="operator"} 1"""


async def broken() -> Answer:
    raise ValueError("a bug")


@awaited
async def test_the_pages_say_what_is_ready_and_what_was_counted() -> None:
    world = World().ready()
    check(world, "TASK_MOVE 9 & wait 1 & TASK_MOVE 1 0 0 0 1 & wait 1 : ACCEPTED+ACCEPTED")
    port, other = free_tcp_ports(2)
    urls = "tcp:127.0.0.1:9", f"tcpin:127.0.0.1:{other}"
    links = [parse_url(url).open(limits=TO_VEHICLES) for url in urls]
    collector = Collector(
        world.server.engine.figures,
        links={LinkSide.VEHICLES: links, LinkSide.CLIENTS: [world.net.link("gcs")]},
        recorders=[],
        restored=Restored(tasks=world.tasks()),
        version="1.2.3",
        woke_at=lambda: world.now,
        clock=lambda: world.now,
    )
    server = HttpServer(listening(f"127.0.0.1:{port}", what="metrics"))
    with pytest.raises(UsageError, match="cannot be opened: Address already in use"):
        listening(f"127.0.0.1:{port}", what="metrics")
    ended = asyncio.new_event_loop()
    ended.close()
    pages: dict[str, Page] = {"/broken": broken}
    for name, loop in (("", asyncio.get_running_loop()), ("/ended", ended)):
        for path, its in Pages(collector, loop=loop, answers=dict).by_path.items():
            pages[name + path] = its
    server.start(pages)

    async def page(path: str) -> str:
        return "{} {}".format(*await asyncio.to_thread(asked, port, path))

    peer = ("127.0.0.1", 1)
    datagrams = Packets("gcs", [(peer, b"12345")], arrived=[0.0])
    for item, expected in (
        (PeerChanged(links[0].name, peer, up=False), "503 no link to a rover is open"),
        (PeerChanged(links[0].name, peer, up=True), "200 ok"),
        (StoreFailed("disk\nfull"), "503 new tasks are refused: disk full"),
        (Committed(1), "200 ok"),
        (HaltNotStored(1), "200 ok"),
        (AtOnce((datagrams, datagrams)), "200 ok"),
        (Shutdown(), "503 the server is ending"),
    ):
        collector.on_input(item, now=world.now)
        assert await page("/readyz") == f"{expected}\n"
    assert len(collector.vehicles([1, 2])[TASKS]) == 2, "two tasks; there is no rover 2 any more"
    check(world, LATER)
    collector.on_output([], world.events(TaskSubmitted), now=world.now)
    collector.on_output([], world.events(TaskChanged), now=world.now)
    second = world.tasks()[1]
    for terms in (second.terms, replace(second.terms, is_staged=True)):
        event = TaskModified(second.id, 1, 2, terms, "a client", world.now)
        collector.on_output([], [event, QueueContinued(1, "a client", 0.0)], now=world.now)
    assert set(LINES.splitlines()) - set((await page("/metrics")).splitlines()) == set()
    for name in ("metrics", "healthz", "readyz"):
        assert await page(f"/ended/{name}") == "503 the event loop has ended\n"
    assert await page("/broken") == "500 internal error\n"
    for note, what in (
        (collector.on_input, [Packets("no such link", [])]),
        (collector.on_output, [[Outgoing("no such link", 1, b"")], []]),
    ):
        with pytest.raises(KeyError):
            note(*what, now=world.now)
    assert await page("/metrics") == "500 nothing is counted: see the log\n"
    await asyncio.to_thread(server.close)
    for link in links:
        link.close()
