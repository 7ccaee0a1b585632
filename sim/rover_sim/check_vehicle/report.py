"""What was checked and what came of it: a line for each check, and a summary."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from enum import Enum


class Outcome(Enum):
    """How a check went; the value stands at the beginning of its line."""

    OK = "ok"
    FAIL = "FAIL"
    SKIPPED = "skipped"
    NOTE = "note"  # not as clients like it, and nothing that the contract demands


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
    """Collects lines, and shows each as it comes."""

    def __init__(self, show: Callable[[Line], None]) -> None:
        self.lines: list[Line] = []
        self.group = ""
        self._show = show

    def __repr__(self) -> str:
        return f"Report({self.summary()})"

    def ok(self, name: str, seen: str) -> None:
        """It is as expected."""
        self._add(name, Outcome.OK, seen)

    def fail(self, name: str, *, expected: str, seen: str) -> None:
        """It is not."""
        self._add(name, Outcome.FAIL, f"expected {expected}; seen: {seen}")

    def skip(self, name: str, why: str) -> None:
        """It could not be, or was not to be, checked."""
        self._add(name, Outcome.SKIPPED, why)

    def note(self, name: str, said: str) -> None:
        """It is worth knowing, and no fault."""
        self._add(name, Outcome.NOTE, said)

    def expect(self, name: str, met: bool, *, expected: str, seen: str) -> bool:
        """Add the line that follows from whether an expectation was met; gives that back."""
        if met:
            self.ok(name, seen)
        else:
            self.fail(name, expected=expected, seen=seen)
        return met

    @property
    def failed(self) -> list[Line]:
        """The lines that failed."""
        return [line for line in self.lines if line.outcome is Outcome.FAIL]

    def summary(self) -> str:
        """Say it in one line."""
        count = {each: sum(line.outcome is each for line in self.lines) for each in Outcome}
        return (
            f"{count[Outcome.OK]} ok, {count[Outcome.FAIL]} failed,"
            f" {count[Outcome.SKIPPED]} skipped, {count[Outcome.NOTE]} notes"
        )

    def as_json(self) -> list[dict[str, str]]:
        """Return the lines for a machine."""
        return [asdict(line) | {"outcome": line.outcome.value} for line in self.lines]

    def _add(self, name: str, outcome: Outcome, said: str) -> None:
        line = Line(self.group, name, outcome, said)
        self.lines.append(line)
        self._show(line)
