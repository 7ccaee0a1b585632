"""The link between gateways, as the server's loop reads it."""

import select
from contextlib import closing

import pytest

from mav_tasks.clock import boot_time
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
            there.send(("to", "b", 1), b"%d" % number)
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
        there.send(("to", "b", 1), b"telemetry")
        wait_until(lambda: b.counts.arrived == 1, within=LIMIT)
        there.send(("to", "b", 1), b"stop", first=True)
        wait_until(lambda: b.counts.arrived == 2, within=LIMIT)
        assert [data for _, data in here.receive(64)] == [b"stop", b"telemetry"]


@pytest.mark.parametrize("wall_is_even", [True, False], ids=["plain", "clock-set"])
def test_the_time_for_which_the_loop_stood_still_counts(
    postgres: PostgresServer, *, wall_is_even: bool
) -> None:
    with carriers(postgres.new_database(), "a", "b") as (a, b):
        there, here = FleetLink(a), FleetLink(b)
        there.send(("to", "b", 1), b"stop", first=True)
        wait_until(lambda: b.counts.arrived == 1, within=LIMIT)
        read_at = boot_time()
        wait_until(lambda: boot_time() > read_at + 0.2, within=LIMIT)
        reader = LinkReader([(here, LinkSide.CLIENTS)], note=lambda _link, _changes: None)
        with closing(reader):
            (found,) = reader.read_late(0.1, wall_is_even=wall_is_even, now=boot_time())
        assert [data for _, data in found.datagrams] == [b"stop"]
        assert found.waited[0] > 0.2
