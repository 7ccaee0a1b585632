"""The link between gateways, as the server's loop reads it."""

import select
from contextlib import closing

from mav_tasks.clock import boot_time
from mav_tasks.engine.clients.elsewhere import ARRIVED
from mav_tasks.engine.inputs import LinkSide
from mav_tasks.fleet_link import FleetLink
from mav_tasks.link_reader import LinkReader
from tests.kit.carriers import LIMIT, carriers
from tests.kit.postgres import PostgresServer
from tests.kit.processes import wait_until

MANY = 100


def is_readable(link: FleetLink) -> bool:
    return bool(select.select([link.fileno()], [], [], 0)[0])


def test_what_a_turn_leaves_keeps_the_link_readable(postgres: PostgresServer) -> None:
    with carriers(postgres.new_database(), "a", "b") as (a, b):
        there, here = FleetLink(a), FleetLink(b)
        for number in range(MANY):
            there.send(("to", "b", 1), arrived(b"%d" % number))
        wait_until(lambda: b.counts.arrived == MANY, within=LIMIT)
        found = []
        while is_readable(here):
            found.append(here.receive(64))
        assert [len(each) for each in found] == [64, MANY - 64]
        assert [data for each in found for _, data in each] == [b"%d" % n for n in range(MANY)]
        assert {peer for each in found for peer, _ in each} == {("a", 1)}


def test_a_stop_overtakes_what_waits_for_the_loop(postgres: PostgresServer) -> None:
    with carriers(postgres.new_database(), "a", "b") as (a, b):
        there, here = FleetLink(a), FleetLink(b)
        there.send(("to", "b", 1), arrived(b"telemetry"))
        wait_until(lambda: b.counts.arrived == 1, within=LIMIT)
        there.send(("to", "b", 1), arrived(b"stop"), first=True)
        wait_until(lambda: b.counts.arrived == 2, within=LIMIT)
        assert [data for _, data in here.receive(64)] == [b"stop", b"telemetry"]


def test_the_time_counts_for_which_it_waited_there_and_here(postgres: PostgresServer) -> None:
    with carriers(postgres.new_database(), "a", "b") as (a, b):
        there, here = FleetLink(a), FleetLink(b)
        came_at = boot_time() - 5.0
        there.send(("to", "b", 1), arrived(b"continue", at=came_at), first=True)
        wait_until(lambda: b.counts.arrived == 1, within=LIMIT)
        sides = [(here, LinkSide.CLIENTS)]
        reader = LinkReader(sides, clock=boot_time, note=lambda _link, _changes: None)
        with closing(reader):
            (found,) = reader.read([here])
        assert [data for _, data in found.datagrams] == [b"continue"]
        assert came_at - 0.5 < found.arrived[0] <= came_at


def arrived(data: bytes, *, at: float | None = None) -> bytes:
    """Return a packet as the engine gives it to the link."""
    return ARRIVED.pack(boot_time() if at is None else at) + data
