"""Map tiles: from an MBTiles file, read with sqlite3, or from a URL that the browser requests."""

import sqlite3
import time
from contextlib import AbstractContextManager, closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from mav_tasks.basics.errors import UsageError
from mav_tasks.basics.folders import at_home

KINDS = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg", b"RIFF": "image/webp"}
DEEPEST = 22
WITHIN = 2.0  # s for a tile
BEGIN_WITHIN = 60.0  # s to look through all of a large file at the start
STEPS = 10_000  # of SQLite's machine between two looks at the time


@dataclass(frozen=True, slots=True)
class Tiles:
    """The tiles of the map. ``path``: None: the browser requests ``url`` itself."""

    url: str
    attribution: str
    least_zoom: int
    most_zoom: int
    path: Path | None

    @property
    def form(self) -> dict[str, Any]:
        """The tiles as JSON."""
        return {
            "url": self.url,
            "attribution": self.attribution,
            "min_zoom": self.least_zoom,
            "max_zoom": self.most_zoom,
        }

    @property
    def origins(self) -> tuple[str, ...]:
        """The sites from which a browser loads them."""
        if self.path is not None:
            return ()
        parts = urlsplit(self.url.replace("{s}.", "*."))
        return (f"{parts.scheme}://{parts.netloc}",)

    def tile(self, zoom: int, column: int, row: int) -> tuple[bytes, str] | None:
        """Return a tile of the file and its media type, None if it has none. Blocks."""
        if self.path is None or not 0 <= zoom <= DEEPEST:
            return None
        query = (
            "SELECT tile_data FROM tiles WHERE zoom_level = ? AND tile_column = ? AND tile_row = ?"
        )
        try:
            with _opened(
                self.path, within=WITHIN
            ) as connection:  # MBTiles counts rows from the south
                south = (1 << zoom) - 1 - row
                found = connection.execute(query, (zoom, column, south)).fetchone()
        except sqlite3.Error:  # the file was damaged, replaced or removed
            return None
        if found is None or not isinstance(found[0], bytes):
            return None
        data = found[0]
        kind = next((kind for start, kind in KINDS.items() if data.startswith(start)), None)
        return None if kind is None else (data, kind)


def tiles_of(text: str) -> Tiles:
    """Return the tiles of ``--tiles``, a file or a URL. Raise UsageError if it is unusable."""
    if text.startswith(("http://", "https://")):
        if not all(part in text for part in ("{z}", "{x}", "{y}")) or '"' in text or ";" in text:
            raise UsageError(f"--tiles {text}: expected a URL with {{z}}, {{x}} and {{y}}")
        return Tiles(text, "", 0, 19, None)
    path = at_home(text, what="--tiles")
    if not path.is_file():
        raise UsageError(f"--tiles {text}: no such file; expected an MBTiles file or a URL")
    try:
        with _opened(path, within=BEGIN_WITHIN) as connection:
            named = dict(connection.execute("SELECT name, value FROM metadata").fetchall())
            zooms = connection.execute("SELECT min(zoom_level), max(zoom_level) FROM tiles")
            least, most = zooms.fetchone()
    except sqlite3.Error as error:
        raise UsageError(f"--tiles {text}: not an MBTiles file: {error}") from error
    if least is None:
        raise UsageError(f"--tiles {text}: it has no tiles")
    if named.get("format") == "pbf":
        raise UsageError(f"--tiles {text}: it has vector tiles; expected PNG, JPEG or WebP")
    attribution = str(named.get("attribution") or "")
    return Tiles("/tiles/{z}/{x}/{y}", attribution, int(least), int(most), path)


def _opened(path: Path, *, within: float) -> AbstractContextManager[sqlite3.Connection]:
    """Open a file for reading for ``within`` seconds: a view in it may compute for ever."""
    connection = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)
    until = time.monotonic() + within
    connection.set_progress_handler(lambda: time.monotonic() > until, STEPS)
    return closing(connection)
