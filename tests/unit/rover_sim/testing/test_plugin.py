"""The pytest plugin as a stranger has it: test files of their own, run by a pytest of their own."""

import subprocess
import sys
from pathlib import Path

import pytest

# What the strangers' tests import is imported here, once for all of them.
import rover_sim.testing.rover_world
from tests.kit.plugin_example import EXAMPLE

assert rover_sim.testing.rover_world

pytest_plugins = ["pytester"]

TAKES = "takes persona=, count=, seed=, body=, frame=, limit=, real_limit=, by name only"
PLUGIN = ("-p", "rover_sim.testing.plugin")


@pytest.fixture(autouse=True)
def strict(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the strangers' pytest load this plugin only: others take a second each time."""
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    pytester.makeini("[pytest]\naddopts = --strict-markers -p no:cacheprovider\n")


def run(pytester: pytest.Pytester, source: str, *options: str) -> pytest.RunResult:
    """Run a stranger's test file in this process."""
    pytester.makepyfile(test_patrol=source)
    return pytester.runpytest_inprocess(*PLUGIN, "-W", "error", *options)


def test_the_example_passes_in_a_process_of_its_own(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_patrol=EXAMPLE)
    result = pytester.runpytest_subprocess(*PLUGIN, "-W", "error")
    result.assert_outcomes(passed=2)
    assert result.duration < 20  # two minutes of driving on a very busy machine


def test_the_example_is_able_to_fail(pytester: pytest.Pytester) -> None:
    broken = EXAMPLE.replace("(2.0, abs", "(3.0, abs").replace("rover.block_wheels()", "pass")
    result = run(pytester, broken)
    result.assert_outcomes(failed=2)
    result.stdout.fnmatch_lines(
        [
            "*- simulated rover -*",
            "ardupilot, kinematic body, * s of virtual time",
            "rover 1 at [12].* m north, * m east, heading * deg, * m/s, armed, hold",
            "*rover 1: task 1 submitted: move 2 m, priority 5, by *",
            "*task 1 completed; * setpoints at 20 Hz: p50 50.0, p99 50.0, max 50.0 ms, 0 late",
        ]
    )


def test_loading_it_imports_nothing_of_ours() -> None:
    code = """
import sys
import pytest
before = set(sys.modules)
import rover_sim.testing.plugin
print(sorted(set(sys.modules) - before))
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=30, check=True
    )
    assert done.stdout == "['rover_sim', 'rover_sim.testing', 'rover_sim.testing.plugin']\n"


def test_the_marker_says_what_is_simulated(pytester: pytest.Pytester) -> None:
    result = run(
        pytester,
        """
        import pytest

        pytestmark = pytest.mark.simulated_rover(persona="px4", seed=7)

        def test_of_the_file(rover, rovers, rover_world):
            assert (rover.persona, len(rovers), rover_world.seed) == ("px4", 1, 7)
            assert rover is rovers[0]

        @pytest.mark.simulated_rover(count=3, persona="generic")
        def test_its_own_goes_before(rovers, rover_world):
            assert [rover.persona for rover in rovers] == ["generic"] * 3
            assert rover_world.seed == 7
        """,
    )
    result.assert_outcomes(passed=2)


def test_what_there_is_not_is_said_in_one_line(pytester: pytest.Pytester) -> None:
    for arguments, said in [
        ('persona="arduplane"', "persona must be one of ardupilot, px4, generic, not 'arduplane'"),
        ('body="lego"', "body must be one of kinematic, bullet, not 'lego'"),
        ("count=0", "count must be 1 to 250, not 0"),
        ("seed='x'", "seed must be a whole number, not 'x'"),
        ("limit=0", "limit must be above 0 seconds, not 0"),
        ("limit=float('nan')", "limit must be above 0 seconds, not nan"),
        (
            '"px4"',
            TAKES,
        ),
        (
            "rovers=2",
            TAKES,
        ),
    ]:
        result = run(
            pytester,
            f"""
            import pytest

            @pytest.mark.simulated_rover({arguments})
            def test_it(rover):
                pass
            """,
        )
        result.assert_outcomes(errors=1)
        assert f"@pytest.mark.simulated_rover: {said}" in result.outlines
        assert "Traceback" not in result.stdout.str()


def test_a_test_without_a_rover_pays_nothing(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        import sys

        def test_it():
            assert not [name for name in sys.modules if name.startswith(("mav_tasks", "pybullet"))]
            assert "rover_sim.testing.plugin" in sys.modules
        """
    )
    result = pytester.runpytest_subprocess(*PLUGIN, "-W", "error")
    result.assert_outcomes(passed=1)
    assert not list(Path(pytester.path).glob("*.sqlite3"))


def test_code_with_a_socket_of_its_own_has_real_processes(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MAV_TASKS_CONFIG", "/nowhere/its-user-s.toml")
    monkeypatch.setenv("MAV_TASKS_STORE", "/nowhere/its-user-s.sqlite3")
    source = """
        import subprocess, sys
        import pytest
        from pymavlink import mavutil

        @pytest.mark.simulated_rover(persona="px4", count=2)
        def test_it(server_url, rover_url):
            for url in (server_url, rover_url):
                link = mavutil.mavlink_connection(url, source_system=255)
                link.mav.heartbeat_send(6, 8, 0, 0, 4)
                assert link.wait_heartbeat(timeout=10).autopilot == 12, "not a PX4"
                link.close()
            raise RuntimeError("both are PX4")
    """
    pytester.makepyfile(test_patrol=source)
    result = pytester.runpytest_subprocess(*PLUGIN)  # pymavlink loads numpy, which cannot be undone
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["E*both are PX4", "*- simulated rover -*", "seed *"])
    result.stdout.fnmatch_lines(["rover_sim:", "mav_tasks.cli:"])
    result.stdout.fnmatch_lines(["*rover 2: found*"])


def test_every_fixture_does_its_part(pytester: pytest.Pytester) -> None:
    result = run(
        pytester,
        """
        import asyncio
        import pytest
        from mav_tasks import Move, TaskState
        from mav_tasks.config.settings import Driving, Settings

        @pytest.fixture
        def task_server_settings():
            return Settings(driving=Driving(speed=1.5))

        def test_settings(task_client, rover, rover_world):
            task_client.submit(Move(8.0))
            rover_world.until(lambda: rover.speed > 1.4, within=15)

        @pytest.mark.parametrize("task_server_settings", [Settings(driving=Driving(speed=0.3))])
        def test_other_settings(task_client, rover, rover_world):
            task_client.submit(Move(8.0))
            rover_world.sleep(10)
            assert 0.2 < rover.speed < 0.4

        def test_restart(task_client, task_server, rover, rover_world):
            task = task_client.submit(Move(8.0))
            rover_world.until(lambda: rover.speed > 0.3)
            task_server.restart()
            assert task_server.task(task.id).state is TaskState.HELD
            assert [str(event) for event in task_server.events][-1] != ""

        def test_lossy_link(task_client, task_server, lossy_link):
            lossy_link(loss=0.3)
            ids = [task_client.submit(Move(0.1)).id for _ in range(5)]
            assert [task.id for task in task_server.tasks] == ids

        @pytest.mark.usefixtures("task_server")
        def test_asyncio(rover_world, rover):
            async def patrol():
                async with rover_world.client() as tasks:
                    task = await tasks.submit(Move(1.0))
                    async with asyncio.timeout(60):
                        return await task.done()

            assert rover_world.run(patrol()).state is TaskState.COMPLETED
            assert rover.north == pytest.approx(1.0, abs=0.05)
        """,
    )
    result.assert_outcomes(passed=5)


def test_a_test_that_waits_for_ever_ends_and_says_for_what(pytester: pytest.Pytester) -> None:
    result = run(
        pytester,
        """
        import asyncio
        import pytest
        from mav_tasks import Move

        async def patrol(client):
            async with client as tasks:
                task = await tasks.submit(Move(1.0))
                await tasks.pause()
                await task.done()

        @pytest.mark.simulated_rover(limit=30)
        @pytest.mark.usefixtures("task_server")
        def test_it(rover_world):
            rover_world.run(patrol(rover_world.client()))
        """,
    )
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        [
            ">       rover_world.run(patrol(rover_world.client()))",
            "E * not over within 30 s of virtual time; at *",
            "E *test_patrol.py:9 patrol: await task.done()",
            "* rover 1: task 1 submitted: move 1 m*",
        ]
    )
    result.stdout.no_fnmatch_line("*_run_once*")
