"""Twenty rovers and a thousand tasks on one page."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from mav_tasks import Move, SyncClient
from tests.browser.kit import PHONE, judge, opened, says
from tests.kit.processes import stand, wait_until
from tests.kit.web import Web, web

pytestmark = pytest.mark.slow

ROVERS, EACH = 20, 50
WALL = (2560, 1440)
LAPTOP = (1280, 800)
#: how many elements of a kind are in sight as a whole
IN_SIGHT = """(kind) => [...document.querySelectorAll(kind)].filter((each) => {
  const box = each.getBoundingClientRect();
  return box.height > 0 && box.top >= 0 && box.bottom <= innerHeight && box.right <= innerWidth;
}).length"""
#: texts that their own element or the window cuts off
CUT = """() => [...document.querySelectorAll('button, .says, .why, .what, .title, .facts, .banner')]
  .filter((each) => each.checkVisibility() && !each.closest('.timeline, .quiet')
    && (each.scrollWidth > each.clientWidth + 1 && getComputedStyle(each).display !== 'inline'
      || each.getBoundingClientRect().right > innerWidth + 1))
  .map((each) => each.outerHTML)"""


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Web]:
    """Twenty paused rovers with fifty tasks each."""
    folder = tmp_path_factory.mktemp("many")
    options = ("--count", str(ROVERS))
    with stand(folder, rover_options=options) as it, web(folder, it) as page:
        wait_until(
            lambda: len(page.get("/vehicles")["vehicles"]) == ROVERS, within=30, what="20 rovers"
        )
        for rover in range(1, ROVERS + 1):
            wait_until(partial(pause, page, rover), within=10, what="a pause")
        url = f"udpout:127.0.0.1:{it.client_port}"
        for half in (0, ROVERS // 2):  # one client may have 500 waiting tasks
            with SyncClient(url, system_id=100 + half) as client:
                for rover in range(half + 1, half + ROVERS // 2 + 1):
                    for _ in range(EACH):
                        client.submit(Move(0.1), vehicle=rover)
        yield page


def pause(it: Web, rover: int) -> bool:
    return it.send("POST", f"/vehicles/{rover}/pause", {}).status_code == 204


def test_all_of_them_are_shown_and_one_is_stopped(chromium: Any, many: Web, shots: Path) -> None:
    counts = [many.get(f"/vehicles/{n}/queue")["waiting_count"] for n in range(1, ROVERS + 1)]
    assert counts == [EACH] * ROVERS
    with opened(chromium, many, size=LAPTOP) as page:
        page.wait_for_function(f"() => document.querySelectorAll('.card').length === {ROVERS}")
        page.wait_for_function(
            f"() => document.querySelectorAll('.rover-mark').length === {ROVERS}"
        )
        assert page.evaluate(IN_SIGHT, ".card") >= 7
        page.click(".card >> nth=6 >> .pick")
        says(page, "#panel-queue .what", "Rover 7: no task runs, 50 wait")
        assert page.evaluate("document.querySelectorAll('#panel-queue .task').length") == EACH
        assert page.evaluate(IN_SIGHT, "#panel-queue .task") >= 8
        assert page.evaluate(CUT) == []
        judge(page, "twenty rovers")
        page.screenshot(path=str(shots / "twenty rovers.png"))
        page.click("#stop-one")
        says(page, "#stop-outcome", "STOP 7: acknowledged")
        says(page, ".card.chosen", "STOP is in force")
        stopped = [
            each["vehicle"]
            for each in many.get("/vehicles")["vehicles"]
            if each["control"] == "stopped"
        ]
        assert stopped == [7]


@pytest.mark.parametrize("size", [PHONE, WALL])
def test_they_are_shown_on_a_phone_and_on_a_wall(
    chromium: Any, many: Web, shots: Path, size: tuple[int, int]
) -> None:
    with opened(chromium, many, size=size) as page:
        page.wait_for_function(f"() => document.querySelectorAll('.card').length === {ROVERS}")
        for view in ("rovers", "map", "side") if size == PHONE else ("",):
            if view:
                page.click(f"[data-show={view}]")
            assert page.evaluate(CUT) == []
            assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
            page.screenshot(path=str(shots / f"twenty rovers {size[0]} {view}.png"))
        if size == WALL:
            assert page.evaluate(IN_SIGHT, ".card") >= 12


#: pixels of the map's canvas: of tracks, which are strong, and all, which are mostly of faint goals
DRAWN = """() => { const canvas = document.querySelector('#map .leaflet-overlay-pane canvas');
  if (!canvas) return [0, 0];
  const {width, height} = canvas;
  const pen = new OffscreenCanvas(width, height).getContext('2d', {willReadFrequently: true});
  pen.drawImage(canvas, 0, 0);
  const data = pen.getImageData(0, 0, width, height).data;
  const alpha = data.filter((_, at) => at % 4 === 3);
  return [alpha.filter((each) => each > 200).length, alpha.filter((each) => each > 0).length]; }"""
BOTH = f"() => {{ const [strong, all] = ({DRAWN})(); return strong > 20 && all > strong + 100; }}"


def test_tracks_and_goals_of_all_are_shown_if_they_are_wanted(
    chromium: Any, many: Web, shots: Path
) -> None:
    goal = {"kind": "goto_global"}
    driven = []
    many.post("/vehicles/1/clear", {})  # the goals of the rover that is shown are drawn, too
    for rover in range(2, 10):
        there = many.get(f"/vehicles/{rover}")
        place = {"latitude": there["latitude"] + 1e-5, "longitude": there["longitude"]}
        body = {"goals": [goal | place], "priority": 9, "label": "away"}
        many.post(f"/vehicles/{rover}/clear", {})
        task = many.post(f"/vehicles/{rover}/tasks", body)
        if rover < 5:
            many.resume(rover)
            driven.append(task["id"])
    for each in driven:  # where 20 rovers and a browser share two processors, a server is late
        while many.wait_for(each, "completed", "held")["state"] == "held":
            body = {"how": "again", "epoch": many.task(each)["halt_epoch"]}
            many.post(f"/tasks/{each}/release", body)
    with opened(chromium, many, size=LAPTOP) as page:
        page.wait_for_function(f"() => document.querySelectorAll('.card').length === {ROVERS}")
        says(page, ".card.chosen", "Rover 1")
        assert page.evaluate(DRAWN) == [0, 0]
        box = page.get_by_label("Tracks and goals of all rovers")
        box.check()
        page.wait_for_function(BOTH)
        judge(page, "tracks of all")
        page.screenshot(path=str(shots / "tracks of all.png"))
        page.reload()  # it is kept
        page.wait_for_function(BOTH)
        box.uncheck()
        page.wait_for_function(f"() => ({DRAWN})()[1] === 0")
    with opened(chromium, many, size=PHONE, scheme="dark") as page:
        page.click("[data-show=map]")
        box = page.get_by_label("Tracks and goals of all rovers")
        box.check()
        page.wait_for_function(BOTH)
        left = [mark.bounding_box()["x"] for mark in page.query_selector_all(".rover-mark")]
        assert max(left) - min(left) > PHONE[0] / 2  # though the map was hidden at first
        assert page.evaluate(CUT) == []
        page.screenshot(path=str(shots / "tracks of all 360.png"))
