"""A pytest plugin that records what servers of tests decide: ``-p record_plugin``.

RECORD_INTO names the folder. Servers in processes of their own are told by the environment.
"""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from taking_down import Recorders  # type: ignore[import-not-found] # it lies beside this file

FOLDER = Path(os.environ["RECORD_INTO"])
RECORDERS = Recorders(FOLDER)


def pytest_sessionstart() -> None:
    """Begin when the tests' own configuration has taken MAV_TASKS_* out of the environment."""
    RECORDERS.install()
    if "RECORD_PROCESSES" in os.environ:
        os.environ["MAV_TASKS_RECORDING_DECISIONS"] = str(FOLDER)


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_teardown(item: pytest.Item) -> Iterator[None]:
    """A test's servers are over when it has been torn down."""
    yield
    RECORDERS.close(item.nodeid)
