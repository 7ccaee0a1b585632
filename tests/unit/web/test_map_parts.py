"""What the map needs: places of tasks, origins, tracks, tiles, previews of plans."""

import sqlite3
from pathlib import Path

import pytest

from mav_tasks.client.fence_form import circle_of, polygon_of, shapes_of
from mav_tasks.client.values import VehicleStatus
from mav_tasks.errors import UsageError
from mav_tasks.plan_files import parse_plan
from mav_tasks.tasks.goal import GlobalPlace, GoTo, LocalPlace, Move, describe
from mav_tasks.web.goal_places import places_of_goals, places_of_words
from mav_tasks.web.origins import Origins
from mav_tasks.web.plan_preview import preview_of
from mav_tasks.web.tiles import tiles_of
from mav_tasks.web.tracks import Tracks

PNG = b"\x89PNG\r\n\x1a\n rest"


def rover(
    north: float = 0.0,
    east: float = 0.0,
    *,
    speed: float = 0.0,
    latitude: float | None = None,
    longitude: float | None = None,
) -> VehicleStatus:
    return VehicleStatus(
        1,
        "ardupilot",
        True,
        "Guided",
        True,
        191,
        north=north,
        east=east,
        yaw=0.0,
        speed=speed,
        latitude=latitude,
        longitude=longitude,
    )


@pytest.mark.parametrize(
    ("place", "shown"),
    [
        (LocalPlace(4.0, -2.25), {"north": 4.0, "east": -2.25}),
        (GlobalPlace(473977000, -85456000), {"latitude": 47.3977, "longitude": -8.5456}),
    ],
)
def test_the_description_of_a_way_names_its_place(
    place: LocalPlace | GlobalPlace, shown: dict[str, float]
) -> None:
    assert places_of_words(describe(GoTo(place))) == [shown]
    assert places_of_goals([Move(1.0), GoTo(place)]) == [shown]


def test_other_descriptions_name_no_place() -> None:
    for words in (describe(Move(2.0)), "return home", "plan of 3 items", "go to x", ""):
        assert places_of_words(words) is None


def test_the_origin_is_where_north_and_east_are_zero() -> None:
    origins = Origins()
    degree = 1 / 111_318.845
    found = origins.of(rover(10.0, 0.0, latitude=47.0 + 10 * degree, longitude=8.0))
    assert found is not None
    assert found["latitude"] == pytest.approx(47.0, abs=1e-9)
    assert found["longitude"] == pytest.approx(8.0)
    moving = rover(10.0, 0.0, speed=1.0, latitude=47.1, longitude=8.0)
    assert origins.of(moving) == found  # two positions of different moments
    assert origins.of(rover(10.0, 0.0, latitude=47.1, longitude=8.0)) != found


def test_the_origin_of_a_rover_without_a_position_is_unknown() -> None:
    assert Origins().of(rover()) is None
    assert Origins().of(rover(latitude=0.0, longitude=0.0)) is None


def test_a_track_is_thinned_and_knows_its_tasks() -> None:
    tracks = Tracks()
    for step in range(100):
        tracks.add(rover(step * 0.02), task=7 if step < 50 else 8, at=step * 0.1)
    points = tracks.of_vehicle(1)
    assert 15 < len(points) < 30
    assert {point[4] for point in points} == {7, 8}
    assert tracks.of_task(7) == [point for point in points if point[4] == 7]
    assert tracks.of_vehicle(1, since=5.0)[0][0] >= 5.0
    standing = Tracks()
    for step in range(100):
        standing.add(rover(), task=None, at=step * 1.0)
    assert len(standing.of_vehicle(1)) == 10
    assert standing.of_vehicle(2) == []


def mbtiles(path: Path, *, format_: str = "png", data: bytes = PNG) -> Path:
    with sqlite3.connect(path) as connection:
        connection.execute("CREATE TABLE metadata (name, value)")
        connection.execute("CREATE TABLE tiles (zoom_level, tile_column, tile_row, tile_data)")
        named = [("format", format_), ("attribution", "somebody")]
        connection.executemany("INSERT INTO metadata VALUES (?, ?)", named)
        connection.execute("INSERT INTO tiles VALUES (2, 1, 3, ?)", (data,))
    connection.close()
    return path


def test_tiles_come_from_a_file_with_rows_from_the_south(tmp_path: Path) -> None:
    tiles = tiles_of(str(mbtiles(tmp_path / "a map.mbtiles")))
    assert tiles.tile(2, 1, 0) == (PNG, "image/png")
    assert tiles.tile(2, 1, 3) is None
    assert tiles.tile(-1, 0, 0) is None
    assert tiles.tile(99, 0, 0) is None
    assert (tiles.least_zoom, tiles.most_zoom, tiles.attribution) == (2, 2, "somebody")
    assert tiles.origins == ()


def test_a_tile_that_is_no_picture_is_not_sent(tmp_path: Path) -> None:
    tiles = tiles_of(str(mbtiles(tmp_path / "x.mbtiles", data=b"<script>")))
    assert tiles.tile(2, 1, 0) is None


def test_a_file_of_tiles_that_computes_for_ever_or_is_damaged_later_has_no_tile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("WITHIN", "BEGIN_WITHIN"):
        monkeypatch.setattr(f"mav_tasks.web.tiles.{name}", 0.1)
    path = mbtiles(tmp_path / "x.mbtiles")
    tiles = tiles_of(str(path))
    with sqlite3.connect(path) as connection:
        connection.execute("DROP TABLE tiles")
        connection.execute(
            "CREATE VIEW tiles AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)"
            " SELECT i AS zoom_level, i AS tile_column, i AS tile_row, 'x' AS tile_data FROM n"
            " WHERE i < 0"
        )
    connection.close()
    assert tiles.tile(2, 1, 0) is None
    with pytest.raises(UsageError, match="interrupted"):
        tiles_of(str(path))
    path.write_bytes(b"x" * 4096)
    assert tiles.tile(2, 1, 0) is None
    path.unlink()
    assert tiles.tile(2, 1, 0) is None


def test_tiles_of_a_site_name_the_site(tmp_path: Path) -> None:
    tiles = tiles_of("https://{s}.tiles.example/{z}/{x}/{y}.png")
    assert tiles.origins == ("https://*.tiles.example",)
    for text in ("https://x/{z}/{x}", 'https://x/{z}/{x}/{y}"', "https://x/{z}/{x}/{y};y"):
        with pytest.raises(UsageError, match="expected a URL with"):
            tiles_of(text)
    with pytest.raises(UsageError, match="no such file"):
        tiles_of(str(tmp_path / "none"))
    (tmp_path / "text").write_text("x" * 4096)
    with pytest.raises(UsageError, match="not an MBTiles file"):
        tiles_of(str(tmp_path / "text"))
    with pytest.raises(UsageError, match="vector tiles"):
        tiles_of(str(mbtiles(tmp_path / "v.mbtiles", format_="pbf")))


def test_a_plan_is_shown_before_it_is_sent() -> None:
    wpl = "QGC WPL 110\n" + "\n".join(
        f"{n}\t0\t{3 * (n > 0)}\t16\t0\t0\t0\t0\t{47.0 + n * 0.001}\t8.0\t0\t1" for n in range(3)
    )
    shown = preview_of(parse_plan(wpl))
    assert [place["latitude"] for place in shown["path"]] == [47.001, 47.002]
    assert shown["length"] == pytest.approx(111.3, abs=0.1)


def test_fences_are_read_and_shown_in_degrees() -> None:
    circle = {"latitude": 47.0, "longitude": 8.0, "radius": 20.0}
    assert shapes_of(circle_of(circle)) == [
        {
            "kind": "circle",
            "inclusion": True,
            "centre": {"latitude": 47.0, "longitude": 8.0},
            "radius": 20.0,
        }
    ]
    places = [{"latitude": 47.0 + n, "longitude": 8.0 * n} for n in range(3)]
    assert shapes_of(polygon_of(places))[0]["points"] == places
    for wrong in (
        {},
        {**circle, "radius": 0},
        {**circle, "latitude": 91},
        {**circle, "radius": True},
    ):
        with pytest.raises(ValueError, match=r"circle\.(radius|latitude)"):
            circle_of(wrong)
    with pytest.raises(ValueError, match=r"polygon\[1\]\.latitude None"):
        polygon_of([places[0], "x", places[1]])
