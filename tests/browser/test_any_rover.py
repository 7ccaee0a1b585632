"""A task for any rover, from the page: where there are several."""

from pathlib import Path
from typing import Any

import pytest

from tests.browser.kit import judge, opened, says
from tests.kit.processes import stand, wait_until
from tests.kit.web import web

pytestmark = pytest.mark.slow


def test_a_task_goes_to_the_rover_that_can_begin_it(
    chromium: Any, tmp_path: Path, shots: Path
) -> None:
    with stand(tmp_path, rover_options=("--count", "2")) as it, web(tmp_path, it) as shown:

        def both() -> bool:
            return len(shown.get("/vehicles")["vehicles"]) == 2

        wait_until(both, within=20, what="2 rovers")
        shown.post("/vehicles/1/pause", {})
        with opened(chromium, shown) as page:
            page.click("text=Add a task…")
            says(page, ".box", "The queue is paused (somebody paused it)")
            page.fill(".box [name=distance]", "0.3")
            page.select_option(".box [name=rover]", "any")
            says(page, ".box", "The server chooses the rover that would begin it first")
            judge(page, "any rover")
            page.screenshot(path=str(shots / "any rover.png"))
            with page.expect_response("**/vehicles/any/tasks") as answered:
                page.click(".box >> text='Add the task'")
            page.wait_for_selector(".box", state="detached")
            says(page, "#panel-queue .what", "Rover 2: ")
            task = answered.value.json()
        assert shown.wait_for(task["id"], "completed")["vehicle"] == 2
        assert shown.get("/vehicles/1/queue")["waiting_count"] == 0
