"""The pages of the metrics, by HTTP: who is ready, the figures, and what cannot be shown."""

import asyncio
from dataclasses import replace

import pytest

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
from mav_tasks.errors import UsageError
from mav_tasks.links.link_limits import TO_VEHICLES
from mav_tasks.links.url import parse_url
from mav_tasks.metrics.collector import Collector
from mav_tasks.metrics.http_server import Answer, HttpServer, listening
from mav_tasks.metrics.pages import Pages
from mav_tasks.tasks.events import QueueContinued, TaskModified, TaskWithdrawn
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.task import TaskId
from tests.kit.awaited import awaited
from tests.kit.client import MOVE
from tests.kit.processes import free_tcp_ports
from tests.kit.scraped import asked, figure, figures_of
from tests.kit.world import World

NO_LINK = (503, "no link to a rover is open\n")
OK = (200, "ok\n")


async def broken() -> Answer:
    raise ValueError("a bug")


@awaited
async def test_the_pages_say_what_is_ready_and_what_was_counted(
    caplog: pytest.LogCaptureFixture,
) -> None:
    world = World().ready()
    first = world.client.move(9.0)
    world.run(1.0)
    world.client.command(MOVE, 1.0, 0, 0, 0, first.task_id)
    world.run(1.0)
    ports = free_tcp_ports(3)
    dialled, listens = (
        parse_url(f"{kind}:127.0.0.1:{port}").open(limits=TO_VEHICLES)
        for kind, port in zip(("tcp", "tcpin"), ports, strict=False)
    )
    collector = Collector(
        world.server.engine.figures,
        links={LinkSide.VEHICLES: [dialled, listens], LinkSide.CLIENTS: [world.net.link("gcs")]},
        recorders=[],
        restored=Restored(tasks=world.tasks()),
        version="1.2.3",
        woke_at=lambda: world.now,
        clock=lambda: world.now,
    )
    address = f"127.0.0.1:{ports[2]}"
    server = HttpServer(listening(address, what="metrics"))
    with pytest.raises(UsageError, match="cannot be opened: Address already in use"):
        listening(address, what="metrics")
    with pytest.raises(UsageError, match=r"no\.such\.host\.invalid:1 cannot be opened"):
        listening("no.such.host.invalid:1", what="metrics")
    pages = Pages(collector, loop=asyncio.get_running_loop(), answers=dict).by_path
    ended, silent = asyncio.new_event_loop(), asyncio.new_event_loop()
    ended.close()
    others = {
        f"/{name}{path}": page
        for name, loop in (("ended", ended), ("silent", silent))
        for path, page in Pages(collector, loop=loop, answers=dict).by_path.items()
    }
    server.start(pages | others | {"/broken": broken})

    async def page(path: str) -> tuple[int, str]:
        return await asyncio.to_thread(asked, ports[2], path)

    peer = ("127.0.0.1", 1)
    datagrams = Packets("gcs", [(peer, b"12345")], arrived=[world.now - 1.0])
    for item, expected in (
        (PeerChanged(dialled.name, peer, up=False), NO_LINK),
        (PeerChanged(dialled.name, peer, up=True), OK),
        (StoreFailed("disk\nfull"), (503, "new tasks are refused: disk full\n")),
        (Committed(1), OK),
        (HaltNotStored(1), OK),
        (AtOnce((datagrams, datagrams)), OK),
        (PeerChanged(dialled.name, peer, up=False), NO_LINK),
        (Shutdown(), (503, "the server is ending\n")),
    ):
        collector.on_input(item, now=world.now)
        assert await page("/readyz") == expected
    second = world.tasks()[1]
    staged = replace(second.terms, is_staged=True)
    events = [
        TaskModified(second.id, 1, 2, terms, "a client", world.now)
        for terms in (second.terms, staged)
    ]
    gone = TaskWithdrawn(TaskId(7), 1, world.now)
    collector.on_output([], [*events, gone, QueueContinued(1, "a client", 0.0)], now=world.now)
    status, text = await page("/metrics")
    assert status == 200, text
    found = figures_of(text)
    for name, labels, expected_figure in (
        ("halts_not_stored_total", {"vehicle": "1"}, 1),
        ("link_bytes_total", {"link": "gcs", "direction": "received"}, 10),
        ("link_up", {"link": listens.name, "side": "vehicles"}, 0),
        ("queue_length", {"vehicle": "1"}, 1),
        ("store_writable", {}, 1),
        ("tasks", {"vehicle": "1", "state": "blocked", "reason": "waiting_for_start"}, 1),
        ("tasks", {"vehicle": "1", "state": "blocked", "reason": "dependency"}, 0),
    ):
        assert figure(found, f"mav_tasks_{name}", **labels) == expected_figure, name
    assert len(found["mav_tasks_link_lost_total"]) == 2
    for name in ("/metrics", "/healthz", "/readyz"):
        assert await page(f"/ended{name}") == (503, "the event loop has ended\n")
    words = "the event loop did not answer within 1 s\n"
    assert await page("/silent/healthz") == (503, words)
    silent.close()
    assert await page("/broken") == (500, "internal error\n")
    assert "metrics: internal error" in caplog.text
    with pytest.raises(KeyError):
        collector.on_input(Packets("no such link", []), now=world.now)
    with pytest.raises(KeyError):
        collector.on_output([Outgoing("no such link", 1, b"")], [], now=world.now)
    assert await page("/metrics") == (500, "nothing is counted: see the log\n")
    await asyncio.to_thread(server.close)
    for link in (dialled, listens):
        link.close()
