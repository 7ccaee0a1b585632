"""The result of the checks: a line for each, and a summary."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from enum import Enum


class Outcome(Enum):
    """Outcome of a check; the value begins its line."""

    OK = "ok"
    FAIL = "FAIL"
    SKIPPED = "skipped"
    NOTE = "note"  # clients would prefer otherwise, but the contract permits it


@dataclass(frozen=True, slots=True)
class Line:
    """One check."""

    group: str
    name: str
    outcome: Outcome
    said: str

    def __str__(self) -> str:
        return f"{self.outcome.value:8}{self.group}: {self.name}: {self.said}"


class Report:
    """Collects lines, and shows each at once."""

    def __init__(self, show: Callable[[Line], None]) -> None:
        self.lines: list[Line] = []
        self.group = ""
        self._show = show

    def __repr__(self) -> str:
        return f"Report({self.summary()})"

    def ok(self, name: str, seen: str) -> None:
        """Add a passed check."""
        self._add(name, Outcome.OK, seen)

    def fail(self, name: str, *, expected: str, seen: str) -> None:
        """Add a failed check."""
        self._add(name, Outcome.FAIL, f"expected {expected}; seen: {seen}")

    def skip(self, name: str, why: str) -> None:
        """Add a check that was impossible or not wanted."""
        self._add(name, Outcome.SKIPPED, why)

    def note(self, name: str, said: str) -> None:
        """Add a remark that is no failure."""
        self._add(name, Outcome.NOTE, said)

    def expect(self, name: str, met: bool, *, expected: str, seen: str) -> bool:
        """Add a passed or failed check; return ``met``."""
        if met:
            self.ok(name, seen)
        else:
            self.fail(name, expected=expected, seen=seen)
        return met

    @property
    def failed(self) -> list[Line]:
        """The lines of failed checks."""
        return [line for line in self.lines if line.outcome is Outcome.FAIL]

    def summary(self) -> str:
        """Return the counts in one line."""
        count = {each: sum(line.outcome is each for line in self.lines) for each in Outcome}
        return (
            f"{count[Outcome.OK]} ok, {count[Outcome.FAIL]} failed,"
            f" {count[Outcome.SKIPPED]} skipped, {count[Outcome.NOTE]} notes"
        )

    def as_json(self) -> list[dict[str, str]]:
        """Return the lines for JSON."""
        return [asdict(line) | {"outcome": line.outcome.value} for line in self.lines]

    def _add(self, name: str, outcome: Outcome, said: str) -> None:
        line = Line(self.group, name, outcome, said)
        self.lines.append(line)
        self._show(line)
