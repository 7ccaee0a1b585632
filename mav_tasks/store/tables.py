"""The SQL texts that make the tables of a store, and that convert those of the version before.

``sql/tables.sql`` is for every kind of database, ``sql/KIND.sql`` has what one kind has beside it,
and ``sql/KIND-N.sql`` converts a database of schema N - 1. A changed table, or a changed meaning of
a stored name (goal, state, field), needs a new N: a text that converts, and the changed tables.
Texts that convert are never edited; the one before the last goes. A new field, goal or event needs
none of this: see ``codec``.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).parent / "sql"


@dataclass(frozen=True, slots=True)
class Tables:
    """The tables of a kind of database. ``words`` are what its SQL calls the types."""

    kind: str
    schema: int
    words: Mapping[str, str]

    def refusal(self, found: int) -> str | None:
        """Say why a database with this schema cannot be used; None: it can. 0: it is empty."""
        if found > self.schema:
            return (
                f"written by a newer version (schema {found}, this one knows {self.schema}):"
                " install that version here, too, or restore an older copy"
            )
        if 0 < found < self.schema - 1:
            return (
                f"written by an old version (schema {found}, this one opens {self.schema - 1} and"
                f" {self.schema}): open it once with a version between, which converts it"
            )
        return None

    def statements(self, found: int) -> Iterator[str]:
        """Yield what makes the present tables of a database with this schema that can be used."""
        for name in ("tables", self.kind) if not found else (f"{self.kind}-{self.schema}",):
            lines = (FOLDER / f"{name}.sql").read_text(encoding="utf-8").splitlines()
            # not every database has each letter of a comment
            text = "\n".join(line for line in lines if not line.startswith("--"))
            for word, meaning in self.words.items():
                text = text.replace(f"{{{word}}}", meaning)
            yield from (each for each in text.split(";") if each.strip())
