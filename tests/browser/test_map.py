"""Recorded runs on the map, and tiles of an MBTiles file below it."""

import shutil
import sqlite3
import struct
import zlib
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from math import asinh, floor, pi, radians, tan
from pathlib import Path
from typing import Any

import pytest

from tests.browser.kit import HOSTILE, judge, move, opened, says, text_of
from tests.kit.processes import stand, wait_until
from tests.kit.web import Web, has_rover, web

pytestmark = pytest.mark.slow

DRIVEN = 1.5  # m
HOME = (-35.363262, 149.165237)
ZOOM = 19
#: pairs of points of a track: driven, silent, placed anew, standing; (time, metres north, east)
GAPS = """() => import('/static/tracks.js').then(({ isGap }) => [[[0, 0, 0], [0.2, 0.3, 0]],
  [[0, 0, 0], [8, 5, 0]], [[0, 0, 0], [0.1, 30, 0]], [[0, 0, 0], [60, 0.2, 0]]]
  .map((each) => isGap(...each)))"""

#: the address and the colour of the tile below the first rover's mark
BELOW = """() => {
  const box = document.querySelector('.rover-mark').getBoundingClientRect();
  const [x, y] = [box.left + box.width / 2, box.top + box.height / 2];
  const tile = [...document.querySelectorAll('img.leaflet-tile-loaded')].find((each) => {
    const found = each.getBoundingClientRect();
    return found.left <= x && x < found.right && found.top <= y && y < found.bottom; });
  if (!tile || !tile.naturalWidth) return null;
  const pen = new OffscreenCanvas(1, 1).getContext('2d');
  pen.drawImage(tile, 0, 0, 1, 1);
  return [new URL(tile.src).pathname, ...pen.getImageData(0, 0, 1, 1).data.slice(0, 3)];
}"""


def tile_of(latitude: float, longitude: float) -> tuple[int, int]:
    """Return column and row of the tile at a place, counted from the north-west."""
    count = 2**ZOOM
    north = asinh(tan(radians(latitude))) / pi
    return floor((longitude / 360 + 0.5) * count), floor((1 - north) / 2 * count)


def colour_of(column: int, row: int) -> tuple[int, int, int]:
    """Return a colour that tells a tile from its neighbours."""
    return 40 + 50 * (column % 4), 40 + 50 * (row % 4), 120


def png(colour: tuple[int, int, int]) -> bytes:
    """Return a tile of one colour."""

    def part(kind: bytes, data: bytes) -> bytes:
        check = struct.pack(">I", zlib.crc32(kind + data))
        return struct.pack(">I", len(data)) + kind + data + check

    head = struct.pack(">IIBBBBB", 256, 256, 8, 2, 0, 0, 0)
    rows = (b"\0" + bytes(colour) * 256) * 256
    chunks = part(b"IHDR", head) + part(b"IDAT", zlib.compress(rows)) + part(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + chunks


def make_tiles(path: Path, column: int, row: int) -> None:
    """Write an MBTiles file with the tiles around one, and nothing beyond them."""
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("CREATE TABLE metadata (name, value)")
        connection.execute("CREATE TABLE tiles (zoom_level, tile_column, tile_row, tile_data)")
        named = [("format", "png"), ("attribution", HOSTILE)]
        connection.executemany("INSERT INTO metadata VALUES (?, ?)", named)
        south = 2**ZOOM - 1  # rows are counted from the south
        around = [(column + x, row + y) for x in (-1, 0, 1) for y in (-1, 0, 1)]
        rows = [(ZOOM, x, south - y, png(colour_of(x, y))) for x, y in around]
        connection.executemany("INSERT INTO tiles VALUES (?, ?, ?, ?)", rows)


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Web, Path]]:
    """A web process with tiles of the rover's yard, and the recording of a move."""
    folder = tmp_path_factory.mktemp("driven")
    records, whole, tiles = (folder / name for name in ("records", "whole", "yard.mbtiles"))
    whole.mkdir()
    make_tiles(tiles, *tile_of(*HOME))
    recording = ("--tlog", str(records), "--record", str(records))
    home = ("--home", f"{HOME[0]},{HOME[1]},584,0")
    shown = ("--records", str(whole), "--tiles", str(tiles))
    with (
        stand(folder, *recording, rover_options=home) as it,
        web(folder, it, *shown) as page,
    ):
        has_rover(page)
        page.wait_for(move(page, DRIVEN)["id"], "completed")
        wait_until(partial(is_whole, page, records, whole), within=20, what="a whole recording")
        yield page, whole


def is_whole(page: Web, records: Path, copies: Path) -> bool:
    """Copy what the server has written so far; return whether the task and its HOLD are in it."""
    for path in records.iterdir():
        shutil.copy(path, copies)
    (run,) = page.get("/records")["records"]
    answer = page.client.get(f"/api/v1/records/{run['name']}")
    if not answer.is_success or "completed" not in answer.text:
        return False
    (rover,) = answer.json()["vehicles"]
    return bool(rover["modes"]) and rover["modes"][-1][1] == "HOLD"


def test_tiles_of_a_file_are_below_the_rover(
    chromium: Any, driven: tuple[Web, Path], shots: Path
) -> None:
    it, _ = driven
    with opened(chromium, it) as page:  # tiles that the file lacks are no errors
        page.wait_for_function(f"() => ({BELOW})()")
        path, *colour = page.evaluate(BELOW)
        rover = it.get("/vehicles/1")
        column, row = tile_of(rover["latitude"], rover["longitude"])
        assert path == f"/tiles/{ZOOM}/{column}/{row}"
        assert tuple(colour) == colour_of(column, row)
        says(page, ".leaflet-control-attribution", HOSTILE)  # words, not HTML
        assert page.query_selector("img[src=x]") is None
        page.screenshot(path=str(shots / "tiles.png"))
        assert page.evaluate(GAPS) == [False, True, True, False]
        page.check("#map-follow input")
        page.click("#map-fit")


AT = """() => { const {x, y} = document.querySelector('.rover-mark').getBoundingClientRect();
  return [x, y]; }"""
#: whether the mark has stayed where it was at the last look
IS_STILL = f"""() => {{ const [before, now] = [window.before, ({AT})().join()];
  window.before = now; return now === before; }}"""
TWO_FRAMES = """() => new Promise(
  (done) => requestAnimationFrame(() => requestAnimationFrame(done)))"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_recorded_run_is_scrubbed_and_played(
    chromium: Any, driven: tuple[Web, Path], shots: Path, scheme: str
) -> None:
    it, records = driven
    (name,) = {path.name.removesuffix(".tlog") for path in records.glob("*.tlog")}
    with opened(chromium, it, scheme=scheme) as page:
        page.click("#tab-records")
        page.click(f"#panel-records .pick >> text={name}")
        page.wait_for_selector("#map.past")
        moment = "#panel-records input[type=range]"

        # scrubbed by keyboard: from its begin to its end
        page.wait_for_function(IS_STILL, polling=300)
        begin = page.evaluate(AT)
        says(page, "#panel-records .why", "rover 1: no position yet")
        page.wait_for_selector(".rover-mark.old")
        page.focus(moment)
        page.keyboard.press("End")
        assert page.input_value(moment) == "1000"
        end = page.evaluate(AT)
        assert begin[1] - end[1] > 20  # px: it drove to the north
        assert abs(begin[0] - end[0]) < 5
        says(page, "#panel-records .log li", "completed")
        says(page, "#panel-records .why", "rover 1: HOLD")
        page.wait_for_selector(".rover-mark:not(.old)")
        judge(page, "a recorded run")
        page.screenshot(path=str(shots / f"recorded {scheme}.png"))
        page.keyboard.press("Home")
        assert page.evaluate(AT) == begin

        # played, paused, played to its end
        while "GUIDED, armed" not in text_of(page, "#panel-records .why"):
            assert page.input_value(moment) != "1000"
            page.keyboard.press("PageUp")
        page.select_option("#panel-records select", label="1 ×")
        before = page.input_value(moment)
        page.click("#panel-records >> text=Play")
        page.wait_for_function(f"() => document.querySelector('{moment}').value > {before}")
        page.click("#panel-records >> text=Pause")
        held = page.input_value(moment)
        assert int(before) < int(held) < 1000
        page.evaluate(TWO_FRAMES)
        assert page.input_value(moment) == held
        page.select_option("#panel-records select", label="60 ×")
        page.click("#panel-records >> text=Play")
        page.wait_for_function(f"() => document.querySelector('{moment}').value === '1000'")
        assert page.evaluate(AT) == end
        assert page.is_visible("#panel-records >> text=Play")

        # the present again
        page.click("#panel-records >> text=← Back to the present")
        page.wait_for_selector("#map:not(.past)")
        page.wait_for_selector(".rover-mark")
