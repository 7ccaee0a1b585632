"""What the command line repeats so as not to load the library, and how commands are made."""

import inspect

import pytest

from mav_tasks.cli import options
from mav_tasks.cli.command import command
from mav_tasks.cli.options import Common, TaskOptions, seconds_of, start_of
from mav_tasks.client.aio import DEFAULT_LINK, FIND_WITHIN
from mav_tasks.errors import UsageError
from mav_tasks.tasks.task import DEFAULT_PRIORITY


def test_defaults_are_those_of_the_library() -> None:
    assert options.DEFAULT_SERVER == Common().server == DEFAULT_LINK
    assert options.PRIORITY == TaskOptions().priority == DEFAULT_PRIORITY
    assert Common().timeout == FIND_WITHIN


def test_a_group_stands_for_its_options() -> None:
    seen: list[object] = []

    async def body(number: int, terms: TaskOptions, common: Common) -> None:
        """Say it."""
        seen.extend((number, terms, common))

    made = command(body)
    names = list(inspect.signature(made).parameters)
    assert names[:3] == ["number", "priority", "after"]
    assert names[-6:] == ["server", "vehicle", "timeout", "sign", "keys", "json"]
    assert (made.__name__, made.__doc__) == ("body", "Say it.")
    defaults = {
        name: each.default
        for name, each in inspect.signature(made).parameters.items()
        if each.default is not inspect.Parameter.empty
    }
    made(**defaults | {"number": 3, "priority": 9, "vehicle": 2})
    assert seen == [3, TaskOptions(priority=9), Common(vehicle=2)]


def test_a_start_is_a_delay_or_a_time_or_neither() -> None:
    assert start_of("", "") == (None, None)
    assert start_of("1m", "") == (60.0, None)
    delay, at = start_of("", "23:59")
    assert delay is None
    assert at is not None
    assert at.tzinfo is not None
    with pytest.raises(UsageError, match="choose one"):
        start_of("1m", "23:59")
    assert seconds_of("--deadline", "") is None
    assert seconds_of("--deadline", "0") == 0.0
