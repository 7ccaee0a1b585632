"""Fails a run in which a test is skipped for a reason that nobody expects.

What a machine may lack is listed here. Each skip is named in pytest's summary in any case.
"""

import pytest

MAY_LACK = (
    "no systemd-analyze",
    "root may write anywhere",
    "may not make a small file system",
    "needs a file system of its own",
    "this machine gives no file system of one's own",
    "this machine does not allow a network of one's own",
    "PostgreSQL",  # pgserver has no wheel for the machine
    "no Chromium",
    "pybullet",  # no wheel for Python 3.12 and later
    "the package that compresses",  # of MCAP, optional there
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
        if self._unexpected and not is_worker and not exitstatus:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Name the reasons."""
        for reason in sorted(self._unexpected):
            terminalreporter.write_line(f"not expected: {reason} (tests/kit/skips.py)")

    def _note(self, report: pytest.TestReport | pytest.CollectReport) -> None:
        if report.skipped and not hasattr(report, "wasxfail"):
            reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else ""
            if not any(each in reason for each in MAY_LACK):
                self._unexpected.add(reason or report.nodeid)
