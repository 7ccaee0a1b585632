"""The pytest plugin: tests of rover code against a simulated rover, in virtual time.

pytest loads it in every run where it is installed, so it imports only pytest; the rest is imported
when a test requests a fixture.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path

    from mav_tasks.client.sync import SyncClient
    from mav_tasks.config.settings import Settings
    from rover_sim.testing.lossy import LossyLink
    from rover_sim.testing.options import RoverOptions
    from rover_sim.testing.processes import RealTime
    from rover_sim.testing.rover_world import RoverWorld
    from rover_sim.testing.simulated_rover import SimulatedRover
    from rover_sim.testing.task_server import TaskServer

MARKER = "simulated_rover"
TITLE = "simulated rover"
OURS = ("mav_tasks", "rover_sim")
DESCRIBE = pytest.StashKey[Callable[[], str]]()  # the state of what a test simulates


@pytest.hookimpl(tryfirst=True)
def pytest_load_initial_conftests(early_config: pytest.Config) -> None:
    """Exclude our own modules from pytest's assertion rewriting.

    pytest rewrites the asserts of every package installed with a plugin. For the generated dialect
    that takes two seconds in each run without cached bytecode, and pytest has no option to exclude
    a module. On a pytest without this private attribute, the rewriting stays.
    """
    marked: set[str] = getattr(early_config.pluginmanager.rewrite_hook, "_must_rewrite", set())
    marked.difference_update(OURS)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add ``--rover-seed``."""
    parser.getgroup(TITLE).addoption(
        "--rover-seed",
        type=int,
        metavar="NUMBER",
        help="seed of simulated rovers and links in tests whose marker names none"
        " (default: each test has one by its name)",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker."""
    config.addinivalue_line(
        "markers",
        f'{MARKER}(persona="ardupilot", count=1, seed=None, body="kinematic", frame="",'
        " limit=3600, real_limit=60): what the fixture rover_world simulates; persona also px4 or"
        " generic, body also bullet, limits in seconds of virtual"
        " and of real time",
    )


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Add the rover's state and the seed to the report of a failing test."""
    report = yield
    if report.failed and (describe := item.stash.get(DESCRIBE, None)):
        report.sections.append((TITLE, describe()))
    return report


@pytest.fixture
def task_server_settings() -> Settings:
    """Return the task server's settings; override or parametrize this fixture to change them."""
    from mav_tasks.config.settings import Settings  # noqa: PLC0415

    return Settings()


@pytest.fixture
def rover_world(
    request: pytest.FixtureRequest, task_server_settings: Settings
) -> Iterator[RoverWorld]:
    """Return the test's world, with ``run`` for a coroutine, ``sleep``, ``until``, ``client``."""
    from rover_sim.errors import MissingExtra  # noqa: PLC0415
    from rover_sim.testing.report import describe_world  # noqa: PLC0415
    from rover_sim.testing.rover_world import RoverWorld  # noqa: PLC0415

    options, seed = _options_of(request)
    try:
        world = RoverWorld(options, seed=seed, settings=task_server_settings)
    except MissingExtra as error:
        pytest.fail(f"@pytest.mark.{MARKER}: {error}", pytrace=False)
    request.node.stash[DESCRIBE] = lambda: describe_world(world)
    yield world
    del request.node.stash[DESCRIBE]  # the world stays inspectable until its last test is over
    world.close()


@pytest.fixture
def rover(rover_world: RoverWorld) -> SimulatedRover:
    """Return the first simulated rover: its true state, and actions on it."""
    return rover_world.rovers[0]


@pytest.fixture
def rovers(rover_world: RoverWorld) -> tuple[SimulatedRover, ...]:
    """Return every simulated rover, as many as the marker's ``count``."""
    return rover_world.rovers


@pytest.fixture
def task_server(rover_world: RoverWorld) -> TaskServer:
    """Return the running task server; it has found every rover."""
    rover_world.server.start()
    rover_world.until(lambda: rover_world.server.is_ready)
    return rover_world.server


@pytest.fixture
def task_client(
    rover_world: RoverWorld,
    task_server: TaskServer,  # noqa: ARG001 (it runs)
) -> Iterator[SyncClient]:
    """Return a client of the task server; each call advances time until its answer comes."""
    with rover_world.sync_client() as client:
        yield client


@pytest.fixture
def lossy_link(rover_world: RoverWorld) -> LossyLink:
    """Return a callable that degrades links: ``lossy_link(loss=0.3)``; ``with`` ends it."""
    return rover_world.lossy_link


@pytest.fixture
def _real_time(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[RealTime]:
    from rover_sim.testing.processes import RealTime  # noqa: PLC0415

    options, seed = _options_of(request)
    real_time = RealTime(options, seed=seed, folder=tmp_path)
    request.node.stash[DESCRIBE] = real_time.describe
    yield real_time
    del request.node.stash[DESCRIBE]
    real_time.close()


@pytest.fixture
def rover_url(_real_time: RealTime) -> str:
    """Return the URL of real-time simulated rovers in a process: ``udpout:127.0.0.1:port``."""
    return _real_time.start_rovers()


@pytest.fixture
def server_url(_real_time: RealTime, rover_url: str) -> str:
    """Return the URL of a real-time task server in a process; it has found every rover."""
    return _real_time.start_server(rover_url)


def _options_of(request: pytest.FixtureRequest) -> tuple[RoverOptions, int]:
    """Return the markers' options and the seed; fail the test if a marker is invalid."""
    from rover_sim.testing.options import MarkerError, read_markers, seed_of  # noqa: PLC0415

    node = request.node
    markers = reversed(list(node.iter_markers(MARKER)))
    try:
        options = read_markers((marker.args, marker.kwargs) for marker in markers)
    except MarkerError as error:
        pytest.fail(f"@pytest.mark.{MARKER}: {error}", pytrace=False)
    seeds = (options.seed, request.config.getoption("--rover-seed"), seed_of(node.nodeid))
    return options, next(seed for seed in seeds if seed is not None)
