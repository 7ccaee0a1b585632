"""Reruns a test that failed while the machine stalled; other failures are not rerun.

A server that does not run for half a second holds its tasks, as it must, and such a failure says
nothing about the test. The rerun gets new shared fixtures, because a server with a held task would
fail the next test.
"""

from collections.abc import Generator, Iterator
from contextlib import contextmanager
from time import monotonic
from typing import Any

import pytest
from _pytest.runner import runtestprotocol

from tests.kit.stalls import StallWatch

AGAIN = 2  # reruns, at most
OUTCOME = "rerun"  # of a report


class MachineStoodStill(AssertionError):
    """A test failed while nothing on this machine ran."""


class RunAgain:
    """The pytest plugin, one instance per test process."""

    def __init__(self) -> None:
        self._watch: StallWatch | None = None
        self._timer: Any = None  # the last setting of pytest-timeout
        self._stood_still = False

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item, nextitem: pytest.Item | None) -> bool:
        """Run a test, instead of pytest's own protocol."""
        if self._watch is None:
            self._watch = StallWatch()
        for times in range(1 + AGAIN):
            if times and self._timer is not None:  # restart it for each run
                item.ihook.pytest_timeout_cancel_timer(item=item)
                item.ihook.pytest_timeout_set_timer(item=item, settings=self._timer)
            self._stood_still = False
            item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
            reports = runtestprotocol(item, nextitem=nextitem, log=False)
            is_over = not self._stood_still or times == AGAIN
            for report in reports:
                if report.failed and not is_over:
                    report.outcome = OUTCOME  # type: ignore[assignment]
                item.ihook.pytest_runtest_logreport(report=report)
            item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
            if is_over:
                break
        return True

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_setup(self) -> Generator[None, None, None]:
        """Detect a stall during the setup."""
        with self._seen():
            return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self) -> Generator[None, None, None]:
        """Detect a stall during the test."""
        with self._seen():
            return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_teardown(self, item: pytest.Item) -> Generator[None, None, None]:
        """Tear down shared fixtures after a stall."""
        yield
        if self._stood_still:
            item.session._setupstate.teardown_exact(None)

    @pytest.hookimpl(wrapper=True, optionalhook=True)
    def pytest_timeout_set_timer(self, settings: Any) -> Generator[None, Any, Any]:
        """Record the setting of a test's timer."""
        self._timer = settings
        return (yield)

    def pytest_report_teststatus(self, report: Any) -> tuple[str, str, str] | None:
        """Return the status letter and word of a rerun."""
        return (OUTCOME, "R", "RERUN") if report.outcome == OUTCOME else None

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """List each rerun with its reason."""
        for report in terminalreporter.getreports(OUTCOME):
            terminalreporter.line(f"RERUN {report.nodeid}: {report.longrepr.reprcrash.message}")

    def pytest_unconfigure(self) -> None:
        """Stop the stall watcher."""
        if self._watch is not None:
            self._watch.close()

    @contextmanager
    def _seen(self) -> Iterator[None]:
        began = monotonic()
        try:
            yield
        except (Exception, pytest.fail.Exception) as failure:
            assert self._watch is not None
            if not (stalls := self._watch.since(began)):
                raise
            self._stood_still = True
            longest = max(stall.end - stall.begin for stall in stalls)
            words = f"{len(stalls)} times, {longest:.2f} s at most"
            raise MachineStoodStill(words) from failure
