"""The thread that keeps a lease, on a real database: what it permits, and what it tells."""

import select
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager

import pytest

from mav_tasks.clock import boot_time
from mav_tasks.errors import StoreError
from mav_tasks.fleet.lease import Permit
from mav_tasks.fleet.member import Change
from mav_tasks.fleet.standing import Effect, Standing
from mav_tasks.fleet_io.keeper import Keeper, News, Parameters, Trouble
from mav_tasks.store.postgres.address import parse
from tests.kit.postgres import PostgresServer, connected
from tests.kit.processes import wait_until

BOTH = frozenset({1, 2})
LIMIT = 10.0  # s


@contextmanager
def kept(url: str, name: str, heard: frozenset[int] = BOTH) -> Iterator[Keeper]:
    with closing(Keeper(parse(url), name, host="127.0.0.1")) as it:
        it.hear(heard)
        yield it


def told(it: Keeper, *wanted: News) -> list[News]:
    """Wait for news by their descriptor until all the wanted ones came; return all."""
    return news_until(it, lambda found: all(each in found for each in wanted))


def news_until(it: Keeper, is_enough: Callable[[list[News]], bool]) -> list[News]:
    """Wait for news by their descriptor until these are enough; return all."""
    found: list[News] = []
    while not is_enough(found):
        fileno = it.fileno()
        assert fileno is not None
        readable, _, _ = select.select([fileno], [], [], LIMIT)
        assert readable, f"only {found} within {LIMIT} s"
        found += it.take()
    return found


def test_it_takes_what_it_hears_and_tells_so(postgres: PostgresServer) -> None:
    with kept(postgres.new_database(), "a") as it:
        news = told(it, Change(got=BOTH))
        others = [each for each in news if not isinstance(each, Permit)]
        assert others == [Parameters(), Change(got=BOTH)]
        assert [vehicle for vehicle in range(4) if it.may_move(vehicle)] == [1, 2]
        assert it.may_stop(1)
        assert it.epoch == 1


def test_each_renewal_is_a_new_permit(postgres: PostgresServer) -> None:
    with kept(postgres.new_database(), "a") as it:
        news = news_until(it, lambda found: len(permits(found)) > 3)
        until = [each.trusted_until for each in permits(news)]
        assert until == sorted(until)
        assert until[0] < until[-1]


def permits(news: list[News]) -> list[Permit]:
    """Return those of a holder."""
    found = [each for each in news if isinstance(each, Permit)]
    return [each for each in found if each.standing is Standing.HOLDER]


def test_parameters_that_are_set_anywhere_are_told_once(postgres: PostgresServer) -> None:
    url = postgres.new_database()
    with kept(url, "a") as it, connected(url) as connection:
        told(it, Parameters())
        connection.execute("INSERT INTO parameters VALUES ('TSK_B', 0.1), ('TSK_A', NULL)")
        told(it, Parameters((("TSK_B", 0.1),)))
        connection.execute("UPDATE parameters SET value = 2 WHERE name = 'TSK_A'")
        news = told(it, Parameters((("TSK_A", 2.0), ("TSK_B", 0.1))))
        news += news_until(it, lambda found: len(permits(found)) > 2)
        assert sum(isinstance(each, Parameters) for each in news) == 1


def test_another_one_has_the_vehicles_after_an_end_in_order(postgres: PostgresServer) -> None:
    url = postgres.new_database()
    with kept(url, "a") as a:
        told(a, Change(got=BOTH))
        with kept(url, "b") as b:
            a.close()
            assert not a.may_move(1)
            assert not a.may_stop(1)
            assert Change((Effect.STOP, Effect.DROP)) in a.take()
            told(b, Change(got=BOTH))
            assert b.may_move(1)
            assert b.epoch == 2


def test_a_hung_database_does_not_delay_the_stop(postgres: PostgresServer) -> None:
    with kept(postgres.new_database(), "a") as it:
        told(it, Change(got=BOTH))
        with postgres.frozen():
            found = told(it, Change((Effect.STOP,)))
            assert not it.may_move(1)
            (trouble,) = [each for each in found if isinstance(each, Trouble)]
            assert trouble.words == "no answer from the database within 0.3 s"
        told(it, Change((Effect.RESUME,)), Trouble(None))
        assert it.may_move(1)


def test_a_machine_that_was_suspended_moves_nothing_from_the_first_moment(
    postgres: PostgresServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its timers do not notice; the clock does, at each question."""
    with kept(postgres.new_database(), "a") as it:
        told(it, Change(got=BOTH))
        permit = it._permit  # as the thread left it, before the suspension
        monkeypatch.setattr("mav_tasks.fleet_io.keeper.boot_time", lambda: boot_time() + 10.0)
        assert not permit.may_move(1, boot_time() + 10.0)
        assert not permit.may_stop(1, boot_time() + 10.0)
        told(it, Change((Effect.PAUSE,)), Change((Effect.RESUME,)))
        assert it.may_move(1)


def test_after_a_mistake_of_ours_nothing_may_move_and_the_loop_is_told(
    postgres: PostgresServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    with kept(postgres.new_database(), "a") as it:
        told(it, Change(got=BOTH))

        def fail(_now: float) -> None:
            raise ZeroDivisionError

        monkeypatch.setattr(it._member, "request", fail)
        wait_until(lambda: not it.may_move(1), within=LIMIT)
        assert not it.may_stop(1)
        with pytest.raises(ZeroDivisionError):
            told(it, Trouble("never"))


def test_a_name_that_is_in_use_or_is_none_is_refused(postgres: PostgresServer) -> None:
    url = postgres.new_database()
    with kept(url, "a") as it:
        told(it, Change(got=BOTH))
        with pytest.raises(StoreError, match="the database has not ended the lost"):
            Keeper(parse(url), "a", host="127.0.0.1")
    with pytest.raises(StoreError, match="a name has up to 40 letters"):
        Keeper(parse(url), "a b", host="127.0.0.1")
    for host in ("nowhere", "192.0.2.1"):
        words = f"gateway a: UDP port 0 of {host}: .*: fleet.address must be an IP address of this"
        with pytest.raises(StoreError, match=words):
            Keeper(parse(url), "a", host=host)
