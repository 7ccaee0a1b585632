"""How a gateway learns of the end of another gateway's task, and that the table keeps that."""

import time
from collections.abc import Iterator
from dataclasses import replace

import pytest

from mav_tasks.engine.inputs import TasksElsewhere
from mav_tasks.tasks.events import TaskChanged, TaskSubmitted
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.task import Progress, TaskId
from tests.kit.postgres import PostgresServer, connected
from tests.kit.processes import wait_until
from tests.unit.store.postgres.gateways import Gateway, away, gateways, of_vehicle

NOTIFIED = 2.5  # s, in less than which one does not look by itself


@pytest.fixture
def url(postgres: PostgresServer) -> str:
    return postgres.new_database()


@pytest.fixture
def pair(url: str) -> Iterator[tuple[Gateway, Gateway]]:
    """Gateway a has task 1; task 1001 at gateway b runs after it."""
    with gateways(url, "a", "b") as (a, b):
        a.store.append([of_vehicle(1, 1)])
        a.kept(1)
        b.store.append([behind(1001, after=1)])
        b.kept(1)
        yield a, b


def behind(number: int, *, after: int) -> TaskSubmitted:
    event = of_vehicle(number, 2)
    terms = replace(event.task.terms, after=after)
    return TaskSubmitted(replace(event.task, terms=terms), event.at)


def becomes(number: int, state: S) -> TaskChanged:
    return TaskChanged(TaskId(number), 1, 2, S.QUEUED, state, R.NONE, "s", 101.0, Progress())


def test_every_question_is_answered_and_then_the_end_is_told(
    pair: tuple[Gateway, Gateway],
) -> None:
    a, b = pair
    for _ in range(2):
        b.store.watch_tasks(frozenset({1, 77}))
        assert b.next(TasksElsewhere).states == ((1, S.QUEUED), (77, None))
    a.store.append([becomes(1, S.STARTING)])
    a.kept(2)
    began = time.monotonic()
    a.store.append([becomes(1, S.COMPLETED)])
    assert b.next(TasksElsewhere).states == ((1, S.COMPLETED),)
    assert time.monotonic() - began < NOTIFIED  # it was notified


def test_an_end_while_the_session_is_lost_is_told_in_the_next_one(
    pair: tuple[Gateway, Gateway], url: str
) -> None:
    a, b = pair
    b.store.watch_tasks(frozenset({1}))
    b.next(TasksElsewhere)
    a.store.append([becomes(1, S.COMPLETED)])
    with connected(url) as connection:
        connection.execute(
            "SELECT pg_terminate_backend(pid) FROM pg_stat_activity"
            " WHERE application_name = 'mav-tasks gateway b tasks'"
        )
    assert b.next(TasksElsewhere).states == ((1, S.COMPLETED),)


def test_without_the_database_it_says_so_once_and_goes_on_later(
    postgres: PostgresServer, pair: tuple[Gateway, Gateway], caplog: pytest.LogCaptureFixture
) -> None:
    a, b = pair
    b.store.watch_tasks(frozenset({1}))
    b.next(TasksElsewhere)
    with away(postgres, a, b):
        b.store.watch_tasks(frozenset({1, 1001}))
        wait_until(lambda: "cannot see" in caplog.text, within=10)
    assert b.next(TasksElsewhere).states == ((1, S.QUEUED), (1001, S.QUEUED))
    assert caplog.text.count("gateway b cannot see tasks of other gateways") == 1
    assert caplog.text.count("gateway b sees tasks of other gateways again") == 1
