"""Tests and their processes do not read the configuration of the user who runs them."""

import gc
import os
import signal
import sys
import threading
from collections.abc import Iterator
from importlib.util import find_spec

import pytest

from tests.kit.places import place as place
from tests.kit.postgres import postgres as postgres
from tests.kit.postgres import postgres_server as postgres_server
from tests.kit.skips import Skips
from tests.kit.volume import LONG_TESTS

for name in [name for name in os.environ if name.startswith("MAV_TASKS_")]:
    del os.environ[name]
os.environ |= {
    "MAV_TASKS_CONFIG": "",
    "MAVLINK20": "1",  # pymavlink fixes its version on its first import, whichever test that is in
    "PIP_NO_COMPILE": "no",  # which asks for it: what is imported is compiled
}

# A shell ignores Ctrl-C in background jobs, and the tests' processes would inherit that.
if (
    threading.current_thread() is threading.main_thread()
    and signal.getsignal(signal.SIGINT) is signal.SIG_IGN
):
    signal.signal(signal.SIGINT, signal.default_int_handler)


TAKE_LONG = {"volume", "timeout"}  # marks


@pytest.fixture(autouse=True)
def closed_stores() -> Iterator[None]:
    """Close the stores of virtual worlds after each test."""
    yield
    module = sys.modules.get("tests.kit.store")
    while module is not None and module.PromptSqliteStore.opened:
        module.PromptSqliteStore.opened.pop().close()


def pytest_configure(config: pytest.Config) -> None:
    """Fail for unexpected skips."""
    config.pluginmanager.register(Skips())


def pytest_collection_finish() -> None:
    """Keep the collector away from thousands of modules and tests: a tenth of the time."""
    gc.freeze()
    gc.set_threshold(50_000, 20, 100)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the longest; skip what lacks something."""
    for item in items:
        if f"\n{item.name}\n" in LONG_TESTS:
            item.add_marker("volume")
    # else the last one runs alone for a minute
    items.sort(key=lambda item: TAKE_LONG.isdisjoint(mark.name for mark in item.iter_markers()))
    for item in () if find_spec("pybullet") else items:
        if item.get_closest_marker("pybullet"):
            item.add_marker(pytest.mark.skip("pybullet has no wheel for this Python"))
