"""Twenty rovers and a thousand tasks on one page."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from mav_tasks import Move, SyncClient
from tests.browser.kit import judge, opened, says
from tests.kit.processes import stand, wait_until
from tests.kit.web import Web, web

pytestmark = pytest.mark.slow

ROVERS, EACH = 20, 50
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
