"""The report of a trial: a page of Markdown, and a picture of the tracks."""

import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from mav_tasks.basics.errors import UsageError, missing
from rover_sim.observing.picture import draw
from rover_sim.observing.track import Place, Track
from rover_sim.trial.rows import Row, Verdict, table

LEAST = 0.1  # m; a track that is shorter is not drawn


def why_no_picture() -> str:
    """Return what to install for a picture, "" if it can be drawn."""
    is_there = find_spec("matplotlib") is not None
    return "" if is_there else f"a picture of the tracks {missing('matplotlib', 'trial')}"


@dataclass
class Report:
    """The rows so far, and where they go to."""

    path: Path
    url: str
    settings: Sequence[str]
    rows: list[Row] = field(default_factory=list)
    rover: str = "not heard"
    ended: str = ""  # why before its time

    def check(self, *, may_replace: bool) -> None:
        """Raise UsageError if it could not be written at the end."""
        for path in (self.path, self.picture):
            if path.exists() and not may_replace:
                raise UsageError(f"{path} exists: name another one with --report, or add --force")
        if not os.access(self.path.parent, os.W_OK):
            raise UsageError(f"--report {self.path}: nothing can be written to {self.path.parent}")

    @property
    def picture(self) -> Path:
        """The picture's file, beside the page."""
        return self.path.with_suffix(".png")

    @property
    def has_failed(self) -> bool:
        """Whether a row failed."""
        return any(row.verdict is Verdict.FAIL for row in self.rows)

    def write(self, track: Track, *, is_true: bool) -> None:
        """Write page and picture."""
        source = "true poses" if is_true else "the rover's own estimate"
        tracks, picture = self._tracks(track), why_no_picture()
        is_drawn = bool(tracks) and not picture
        if is_drawn:
            picture = f"![tracks]({self.picture.name})\n\nBy {source}; north is up."
        count = {each: sum(row.verdict is each for row in self.rows) for each in Verdict}
        lines = [
            "# Field trial",
            "",
            ", ".join(f"{number} {each.value}" for each, number in count.items()),
            *(["", f"**Ended before its time: {self.ended}**"] if self.ended else []),
            "",
            *table(self.rows),
            "",
            "## What was tried, with what",
            "",
            *(f"- {name}: {words}" for name, words in self._facts(source).items()),
            "",
            "## Tracks",
            "",
            picture if tracks else "No track: the rover did not move.",
        ]
        self.path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        if is_drawn:
            draw(tracks, self.picture)

    def _tracks(self, track: Track) -> Mapping[str, Sequence[Place]]:
        tracks: dict[str, Sequence[Place]] = {}
        for row in self.rows:
            places = track.between(row.begun, row.ended)
            if any(place.apart(places[0]) > LEAST for place in places):
                tracks[f"{row.kind.title}: {row.verdict.value}"] = places
        return tracks

    def _facts(self, source: str) -> Mapping[str, str]:
        return {
            "date": f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
            "rover": f"{self.rover}, at {self.url}",
            "poses": source,
            "settings": ", ".join(self.settings) or "default",
            "mav-tasks": version("mav-tasks"),
            "Python": f"{platform.python_version()} on {platform.system()} {platform.machine()}",
        }
