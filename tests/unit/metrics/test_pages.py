"""The pages, from their own thread, while the event loop turns, is blocked, or has ended."""

import asyncio
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager

import pytest

from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import (
    Committed,
    LinkSide,
    Outgoing,
    PeerChanged,
    Shutdown,
    StoreFailed,
)
from mav_tasks.links.base import Link
from mav_tasks.links.link_limits import TO_VEHICLES
from mav_tasks.links.memory import MemoryNet
from mav_tasks.links.url import parse_url
from mav_tasks.metrics import pages
from mav_tasks.metrics.collector import Collector
from mav_tasks.metrics.http_server import Answer, Page
from mav_tasks.metrics.pages import Pages
from mav_tasks.observer import EngineObservers
from mav_tasks.settings import Settings
from tests.kit.processes import free_tcp_ports
from tests.kit.scraped import figure, figures_of

NOW = 100.0


def tcp_link(kind: str) -> Link:
    """Return a link to rovers without a connection."""
    (port,) = free_tcp_ports(1)
    return parse_url(f"{kind}:127.0.0.1:{port}").open(limits=TO_VEHICLES)


def collector_of(*vehicles: Link) -> Collector:
    return Collector(
        Engine(Settings(), now=NOW).figures,
        links={LinkSide.CLIENTS: [MemoryNet().link("clients")], LinkSide.VEHICLES: vehicles},
        recorders=[],
        restored=None,
        version="1.2.3",
        woke_at=lambda: NOW,
        clock=lambda: NOW,
    )


@contextmanager
def turning() -> Iterator[asyncio.AbstractEventLoop]:
    """Run an event loop in another thread, as the server's."""
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever)
    thread.start()
    try:
        yield loop
    finally:
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()


def run(page: Page) -> tuple[int, str]:
    async def one() -> Answer:
        return await page()

    answer = asyncio.run(one())
    return answer.status, answer.body.decode()


def test_a_loop_that_turns_is_healthy_and_gives_its_figures() -> None:
    collector = collector_of(MemoryNet().link("rovers"))
    collector.on_input(None, now=NOW)
    with turning() as loop:
        its = Pages(collector, loop=loop, answers=dict).by_path
        assert run(its["/healthz"]) == (200, "ok\n")
        assert run(its["/readyz"]) == (200, "ok\n")
        status, text = run(its["/metrics"])
    found = figures_of(text)
    assert status == 200
    assert figure(found, "mav_tasks_engine_inputs_total") == 1
    assert figure(found, "process_open_fds") > 2
    (labels,) = found["mav_tasks_build_info"]
    assert ("version", "1.2.3") in labels


def test_a_loop_that_is_blocked_is_said_to_be(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pages, "LOOP_WITHIN", 0.05)
    blocked = threading.Event()
    with turning() as loop:
        its = Pages(collector_of(), loop=loop, answers=dict).by_path
        loop.call_soon_threadsafe(blocked.wait)
        wanted = (503, "the event loop did not answer within 0.05 s\n")
        try:
            assert [run(its[path]) for path in ("/healthz", "/readyz", "/metrics")] == [wanted] * 3
        finally:
            blocked.set()


def test_a_loop_that_has_ended_is_said_to_have() -> None:
    with turning() as loop:
        its = Pages(collector_of(), loop=loop, answers=dict).by_path
    assert run(its["/healthz"]) == (503, "the event loop has ended\n")


def test_scrapers_within_a_second_share_one_text() -> None:
    collector = collector_of()
    with turning() as loop:
        its = Pages(collector, loop=loop, answers=dict).by_path

        async def several() -> list[Answer]:
            first = await asyncio.gather(*(its["/metrics"]() for _ in range(20)))
            collector.on_input(None, now=NOW)
            return [*first, await its["/metrics"]()]

        texts = {answer.body for answer in asyncio.run(several())}
    assert len(texts) == 1


def test_a_bug_where_the_figures_are_read_is_an_internal_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    collector = collector_of()
    monkeypatch.setattr(collector, "totals", lambda: 1 / 0)
    with turning() as loop:
        its = Pages(collector, loop=loop, answers=dict).by_path
        with pytest.raises(ZeroDivisionError):
            run(its["/metrics"])


def test_figures_that_are_no_longer_counted_are_not_shown() -> None:
    collector = collector_of()
    observers = EngineObservers([collector])
    observers.on_output([Outgoing("no such link", 1, b"")], [], now=NOW)
    assert repr(observers) == "EngineObservers([])"
    with turning() as loop:
        its = Pages(collector, loop=loop, answers=dict).by_path
        assert run(its["/metrics"]) == (500, "nothing is counted: see the log\n")


def test_it_is_ready_while_the_store_works_and_a_rover_can_be_reached() -> None:
    with closing(tcp_link("tcp")) as link:
        collector = collector_of(link)
    name, peer = link.name, ("127.0.0.1", 1)
    no_link = "no link to a rover is open"
    assert collector.why_not_ready() == no_link
    collector.on_input(PeerChanged(name, peer, up=False), now=NOW)  # dialled in vain
    assert collector.why_not_ready() == no_link
    collector.on_input(PeerChanged(name, peer, up=True), now=NOW)
    assert collector.why_not_ready() == ""
    collector.on_input(StoreFailed("disk\nfull"), now=NOW)
    assert collector.why_not_ready() == "new tasks are refused: disk full"
    collector.on_input(Committed(1), now=NOW)
    assert collector.why_not_ready() == ""
    collector.on_input(PeerChanged(name, peer, up=False), now=NOW)
    assert collector.why_not_ready() == no_link
    collector.on_input(Shutdown(), now=NOW)
    assert collector.why_not_ready() == "the server is ending"


def test_the_counters_of_links_are_shown() -> None:
    with closing(tcp_link("tcp")) as dialled, closing(tcp_link("tcpin")) as listens:
        for _ in range(7):
            dialled.send(("127.0.0.1", 1), b"to nobody")
        with turning() as loop:
            its = Pages(collector_of(dialled, listens), loop=loop, answers=dict).by_path
            found = figures_of(run(its["/metrics"])[1])
    lost, refused = "mav_tasks_link_lost_total", "mav_tasks_link_refused_connections_total"
    assert figure(found, lost, link=dialled.name) == 7
    assert len(found[lost]) == 2
    assert list(found[refused]) == [frozenset({("link", listens.name)})]
    for link in (dialled, listens):
        assert figure(found, "mav_tasks_link_up", link=link.name, side="vehicles") == 0
