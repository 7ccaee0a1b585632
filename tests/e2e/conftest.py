"""Shows the crash matrix at the end of a run."""

from typing import Any


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Print a line for each point at which the server was killed."""
    lines = [
        f"{value}  {'ok' if report.passed else 'FAILED'}"
        for outcome in ("passed", "failed")
        for report in terminalreporter.getreports(outcome)
        for name, value in report.user_properties
        if name == "crash"
    ]
    if lines:
        terminalreporter.section("crash points: queue and tasks after the restart")
        for line in lines:
            terminalreporter.line(line)
