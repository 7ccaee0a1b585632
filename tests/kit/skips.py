"""Fails a run in which a test is skipped for a reason that nobody expects, as CI runs it.

What a machine may lack is listed here. Each skip is named in pytest's summary in any case.
"""

import os
import re

import pytest

STRICT = "NO_UNEXPECTED_SKIPS"  # set by tools/test --all
MAY_LACK = re.compile(
    r"no Python 3|no systemd-analyze|root may write anywhere|may not make a small file system"
    r"|needs a file system of its own|PostgreSQL|playwright is missing|browser|axe|the core is"
    r" compiled|pybullet|this machine|the package that compresses"
)


class Skips:
    """The pytest plugin: it has the unexpected reasons for which tests were skipped."""

    def __init__(self) -> None:
        self._unexpected: set[str] = set()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note a skipped test."""
        self._note(report)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Note a skipped module."""
        self._note(report)

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session, exitstatus: int) -> None:
        """Fail the run; the first failure's status stays."""
        is_worker = hasattr(session.config, "workerinput")
        if self._unexpected and STRICT in os.environ and not is_worker and not exitstatus:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Name the reasons."""
        for reason in sorted(self._unexpected):
            terminalreporter.write_line(f"not expected: {reason} (tests/kit/skips.py)")

    def _note(self, report: pytest.TestReport | pytest.CollectReport) -> None:
        if report.skipped and not hasattr(report, "wasxfail"):
            reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else ""
            if not MAY_LACK.search(reason):
                self._unexpected.add(reason or report.nodeid)
