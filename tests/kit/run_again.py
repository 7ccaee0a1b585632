"""Runs a test again that failed while the machine stood still; nothing else is run again.

A server kept from running for half a second holds what it drives, as it must. Such a failure says
nothing of what was tried. The test begins anew with all that it shares with others: a server that
holds a task would fail whoever comes next.
"""

from collections.abc import Generator, Iterator
from contextlib import contextmanager
from time import monotonic
from typing import Any

import pytest
from _pytest.runner import runtestprotocol

from tests.kit.stalls import StallWatch

AGAIN = 2  # times at the most
OUTCOME = "rerun"  # of a report


class MachineStoodStill(AssertionError):
    """What failed did so while nothing on this machine ran."""


class RunAgain:
    """The plugin of pytest that does it, in each process that runs tests."""

    def __init__(self) -> None:
        self._watch: StallWatch | None = None
        self._timer: Any = None  # what pytest-timeout was last set to
        self._stood_still = False

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item, nextitem: pytest.Item | None) -> bool:
        """Run a test, in the place of pytest's own."""
        if self._watch is None:
            self._watch = StallWatch()
        for times in range(1 + AGAIN):
            if times and self._timer is not None:  # each time for itself
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
        """See whether what fails in a fixture has such a cause."""
        with self._seen():
            return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self) -> Generator[None, None, None]:
        """See whether what fails in the test itself has such a cause."""
        with self._seen():
            return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_teardown(self, item: pytest.Item) -> Generator[None, None, None]:
        """Leave nothing of it to whatever comes next."""
        yield
        if self._stood_still:
            item.session._setupstate.teardown_exact(None)

    @pytest.hookimpl(wrapper=True, optionalhook=True)
    def pytest_timeout_set_timer(self, settings: Any) -> Generator[None, Any, Any]:
        """Note to what a test's timer is set."""
        self._timer = settings
        return (yield)

    def pytest_report_teststatus(self, report: Any) -> tuple[str, str, str] | None:
        """Return the letter and the word that are shown."""
        return (OUTCOME, "R", "RERUN") if report.outcome == OUTCOME else None

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """Name each that was run again, and why."""
        for report in terminalreporter.getreports(OUTCOME):
            terminalreporter.line(f"RERUN {report.nodeid}: {report.longrepr.reprcrash.message}")

    def pytest_unconfigure(self) -> None:
        """End the watcher."""
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
