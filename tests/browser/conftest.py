"""A real Chromium, driven by playwright; without one these tests are skipped, and say so."""

import os
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from tests.kit.processes import Stand
from tests.kit.web import Web, served

pytest.importorskip("playwright.sync_api", reason="playwright is missing")

#: what a browser itself logs for an answer that a test provokes
OF_THE_BROWSER = "Failed to load resource"


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    """One browser process for the tests of a module.

    Not of a session: while playwright is open it runs an event loop in this thread, and tests of
    other modules begin loops of their own.
    """
    from tests.kit.chromium import running

    with ExitStack() as stack:
        try:
            browser = stack.enter_context(running())
        except FileNotFoundError as missing:
            pytest.skip(str(missing))
        yield browser


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Stand, Web]]:
    """One server, rover and web process for all tests of a file."""
    with served(tmp_path_factory.mktemp("browser")) as it:
        yield it


@pytest.fixture
def it(both: tuple[Stand, Web]) -> Iterator[Web]:
    """The web process; afterwards nothing waits and nothing is paused."""
    yield both[1]
    both[1].empty()


@pytest.fixture
def shots(tmp_path: Path) -> Path:
    """The folder of screenshots: SCREENSHOTS, else this test's own."""
    folder = Path(os.environ.get("SCREENSHOTS") or tmp_path)
    folder.mkdir(parents=True, exist_ok=True)
    return folder
