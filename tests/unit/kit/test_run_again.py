"""Tests of what is run again and what is not, by a pytest of its own."""

from collections.abc import Callable

import pytest

import tests.kit.run_again
from tests.kit.run_again import AGAIN, RunAgain
from tests.kit.stalls import Stall

pytest_plugins = ["pytester"]

FILE = """
import pytest

made, runs = [], []

@pytest.fixture(scope="module")
def shared():
    made.append(1)
    yield len(made)
    made.append("ended")

def test_first(shared):
    assert shared == 1

def test_second(shared):
    runs.append(1)
    assert len(runs) > {failures}

def test_third(shared):
    assert made == {made}
"""

Run = Callable[..., pytest.RunResult]


class Watch:
    """Saw the machine stand still as often as it is told."""

    left = 0

    def since(self, begin: float) -> list[Stall]:
        if self.left == 0:
            return []
        self.left -= 1
        return [Stall(begin, begin + 1.5)]

    def close(self) -> None:
        """There is nothing to end."""


@pytest.fixture
def run(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> Run:
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")

    def run_with(source: str, *, stalls: int) -> pytest.RunResult:
        watch = Watch()
        watch.left = stalls
        monkeypatch.setattr(tests.kit.run_again, "StallWatch", lambda: watch)
        pytester.makepyfile(test_it=source)
        return pytester.runpytest_inprocess("-p", "no:cacheprovider", plugins=[RunAgain()])

    return run_with


def test_what_failed_while_the_machine_stood_still_is_run_again_with_all_new(run: Run) -> None:
    result = run(FILE.format(failures=1, made=[1, "ended", 1]), stalls=1)
    result.assert_outcomes(passed=3)
    result.stdout.fnmatch_lines(
        [
            "test_it.py .R..*",
            "RERUN test_it.py::test_second: *MachineStoodStill: 1 times, 1.50 s at most",
            "*3 passed, 1 rerun in *",
        ]
    )


def test_what_fails_by_itself_is_not_run_again(run: Run) -> None:
    result = run(FILE.format(failures=1, made=[1]), stalls=0)
    result.assert_outcomes(passed=2, failed=1)
    result.stdout.fnmatch_lines(["test_it.py .F.*"])


def test_a_machine_that_stands_still_each_time_does_not_make_it_pass(run: Run) -> None:
    result = run(FILE.format(failures=9, made=[1, *("ended", 1) * (AGAIN + 1)]), stalls=9)
    result.assert_outcomes(passed=2, failed=1)
    result.stdout.fnmatch_lines(["test_it.py .RRF.*", "*1 failed, 2 passed, 2 rerun in *"])


def test_what_cannot_begin_while_the_machine_stands_still_is_run_again(run: Run) -> None:
    source = """
import pytest

begun = []

@pytest.fixture(scope="module")
def shared():
    begun.append(1)
    assert len(begun) > 1, "no answer"

def test_it(shared):
    pass
"""
    run(source, stalls=1).assert_outcomes(passed=1)
    run(source, stalls=0).assert_outcomes(errors=1)
