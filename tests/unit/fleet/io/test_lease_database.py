"""Leases in PostgreSQL: each answer is that of the model, for which the rules were proved."""

import os
import random
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from typing import Any

import pytest

from mav_tasks.basics.errors import StoreError
from mav_tasks.fleet.io.lease_database import LIMITS, LeaseDatabase
from mav_tasks.fleet.member import Evict, Free, Join, Renew, Request, Row, Take
from mav_tasks.fleet.rivals import Eviction
from mav_tasks.store.postgres.address import parse
from mav_tasks.store.postgres.failures import PostgresError
from mav_tasks.store.postgres.session import Limits
from tests.kit.gateways.database import Database
from tests.kit.postgres import PostgresServer, connected
from tests.kit.processes import wait_until

NAMES = ("a", "b", "c")
STEPS = 400
NAME_LOCK = 0x4D565454  # of the locks of names


def opened(url: str, name: str, **options: Any) -> LeaseDatabase:
    """Return a gateway's sessions, by default with the patience of a machine that is busy."""
    options = {"limits": Limits()} | options
    return LeaseDatabase(parse(url), name, host="127.0.0.1", port=1, **options)


@contextmanager
def gateways(url: str) -> Iterator[dict[str, LeaseDatabase]]:
    with ExitStack() as open_ones:
        yield {name: open_ones.enter_context(closing(opened(url, name))) for name in NAMES}


def sessions(url: str) -> int:
    """Return how many names are locked."""
    with connected(url) as it:
        query = "SELECT count(*) FROM pg_locks WHERE locktype = 'advisory' AND classid = %s"
        (found,) = it.execute(query, (NAME_LOCK,)).fetchone()
        return int(found)


def plain(row: Row) -> Row:
    """Return the row with its rivals in the order of their names."""
    return replace(row, rivals=tuple(sorted(row.rivals, key=lambda each: each.name)))


def chosen(chance: random.Random, name: str, model: Database) -> Request:
    """Return a request, which is mostly one that makes sense."""

    def eviction(of: str) -> Eviction:
        row = model.rows.get(of)
        epoch, renewals = (row.epoch, row.renewals) if row else (1, 0)
        wrong = chance.choice((*[(0, 0)] * 7, (1, 0), (0, 1), (-1, 0)))
        return Eviction(of, epoch + wrong[0], renewals + wrong[1])

    mine = model.rows.get(name)
    epoch = (mine.epoch if mine else 1) + chance.choice((*[0] * 8, 1, -1))
    vehicles = frozenset(chance.sample(range(1, 8), chance.randint(1, 4)))
    me = Renew(name, epoch or 9, vehicles)  # a member never asks with 0, which is nobody's epoch
    match chance.randrange(10):
        case 0 | 1:
            return Join(name, eviction(name) if chance.random() < 0.5 else None)
        case 2 | 9:
            other = chance.choice([each for each in NAMES if each != name])
            return Evict(me, eviction(other))
        case 3 | 4 | 5:
            return Take(me, vehicles)
        case 6:
            return Free(me, min(vehicles))
        case _:
            return me


@pytest.mark.parametrize("seed", range(3))
def test_each_answer_is_that_of_the_model(postgres: PostgresServer, seed: int) -> None:
    chance = random.Random(seed)
    url, model = postgres.new_database(), Database()
    held = 0
    with gateways(url) as real:
        for name in NAMES:
            model.connect(name)
        for step in range(STEPS):
            name = chance.choice(NAMES)
            if chance.random() < 0.1:
                if name in model.sessions:
                    real[name].close()
                    del model.sessions[name]
                    wait_until(lambda: sessions(url) == len(model.sessions), within=5)
                else:
                    real[name].connect()
                    model.connect(name)
            elif name in model.sessions:
                request = chosen(chance, name, model)
                expected = plain(model.execute(name, request))
                found = plain(real[name].execute(request).row)
                assert found == expected, f"seed {seed}, step {step}: {request}"
                held += len(expected.holds)
    assert held > STEPS / 10
    assert model.takeovers > 3


def test_two_that_evict_each_other_do_not_wait_for_each_other(postgres: PostgresServer) -> None:
    """The second one is refused: its own row was evicted before."""
    url = postgres.new_database()
    with gateways(url) as real, ThreadPoolExecutor() as threads:
        for _ in range(20):
            a, b = (real[name].execute(Join(name)).row.epoch for name in ("a", "b"))
            both = [
                threads.submit(real["a"].execute, Evict(Renew("a", a), Eviction("b", b, 0))),
                threads.submit(real["b"].execute, Evict(Renew("b", b), Eviction("a", a, 0))),
            ]
            granted = [each.result().row.epoch for each in both]
            assert granted in ([a, 0], [0, b])
            with connected(url) as it:
                it.execute("UPDATE gateways SET epoch = 0")  # all leave


def test_gateways_that_begin_at_one_time_make_the_tables_once(postgres: PostgresServer) -> None:
    url = postgres.new_database()
    with ThreadPoolExecutor() as threads:
        begun = list(threads.map(lambda name: opened(url, name), "abcdef"))
    assert {each.secret for each in begun} == {begun[0].secret}
    for each in begun:
        assert each.execute(Join(each.name)).row.epoch
        each.close()


CHILD = """
import sys
from mav_tasks.fleet.member import Join
from mav_tasks.fleet.io.lease_database import LeaseDatabase
from mav_tasks.store.postgres.address import parse
it = LeaseDatabase(parse(sys.argv[1]), "a", host="127.0.0.1", port=1)
it.execute(Join("a"))
print("joined", flush=True)
sys.stdin.read()
"""


def test_a_second_process_of_a_name_is_refused_and_the_first_one_named(
    postgres: PostgresServer,
) -> None:
    url = postgres.new_database()
    with subprocess.Popen(
        [sys.executable, "-c", CHILD, url], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as first:
        assert first.stdout is not None
        assert first.stdout.readline() == b"joined\n"
        with pytest.raises(StoreError) as told:
            opened(url, "a")
        assert re.search(
            rf"the gateway name a is in use by a process on {os.uname().nodename},"
            rf" pid {first.pid}, since 2.*: end that one, or choose another name",
            str(told.value),
        )
        with closing(opened(url, "b")) as other:  # another name is free
            other.execute(Join("b"))
        first.send_signal(signal.SIGKILL)
    wait_until(lambda: sessions(url) == 0, within=5)
    with closing(opened(url, "a")) as second:
        row = second.execute(Join("a")).row
        assert row.epoch == 0, "it has to wait for the term of the first one"
        (ghost,) = [each for each in row.rivals if each.name == "a"]
        assert not ghost.in_session
        assert second.execute(Join("a", Eviction("a", ghost.epoch, ghost.renewals))).row.epoch


def test_a_gateway_with_another_system_id_than_one_that_runs_is_refused(
    postgres: PostgresServer,
) -> None:
    url = postgres.new_database()
    with closing(opened(url, "a", system_id=250)):
        opened(url, "b", system_id=250).close()
        with pytest.raises(StoreError, match="system_id is 249 here and 250 at gateway a: all"):
            opened(url, "b", system_id=249)
    with (  # a does not run: all of the fleet can get another one
        closing(opened(url, "b", system_id=249)),
        pytest.raises(StoreError, match="system_id is 250 here and 249 at gateway b"),
    ):
        opened(url, "a", system_id=250)


def test_a_gateway_waits_for_a_hung_database_no_longer_than_its_limits(
    postgres: PostgresServer,
) -> None:
    url = postgres.new_database()
    with closing(opened(url, "a", limits=LIMITS)) as it:
        epoch = it.execute(Join("a")).row.epoch
        with postgres.frozen(), pytest.raises(PostgresError, match=r"no answer .* within 0\.3 s"):
            it.execute(Renew("a", epoch))
        it.connect()
        assert it.execute(Renew("a", epoch)).row.epoch == epoch
