"""Take the pictures of the web page that the guide shows, into mav_tasks/guide/images.

They show a real server and a simulated rover in a real Chromium, so each run's differ a little:
take them again when the page has changed, and look at them. `.venv/bin/python` runs this file.
"""

import os
import shutil
import sys
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from PIL import Image
from playwright.sync_api import ViewportSize, sync_playwright

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "sim")]

from tests.kit.web import Web, served  # noqa: E402

FOLDER = ROOT / "mav_tasks/guide/images"
SIZE: ViewportSize = {"width": 1280, "height": 720}
TALL: ViewportSize = {"width": 1280, "height": 980}  # has room for the whole form
COLOURS = 64


def main() -> None:
    """Take all pictures."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    path = next(filter(None, map(shutil.which, ("chromium-headless-shell", "chromium"))), None)
    options = ["--no-sandbox"] if os.geteuid() == 0 else []
    with (
        TemporaryDirectory() as folder,
        served(Path(folder)) as (_, web),
        sync_playwright() as playwright,
        playwright.chromium.launch(executable_path=path, args=options) as browser,
    ):
        page = browser.new_page(viewport=SIZE, locale="en-GB", color_scheme="light")
        page.goto(web.url)
        page.wait_for_selector(".rover-mark", state="attached")
        _take(page, web)


def _take(page: Any, web: Web) -> None:
    def submit(*goals: dict[str, Any], **terms: Any) -> int:
        task: int = web.post("/vehicles/1/tasks", {"goals": goals} | terms)["id"]
        return task

    corners = ((6, 0), (6, 8), (0, 8), (0, 0))
    patrol = submit(*(_to(*corner, speed=1.0) for corner in corners), label="patrol")
    submit(_to(3, -4), label="to the gate", priority=8)
    submit({"kind": "wait", "duration": 60}, after=patrol)
    submit(_to(-4, 3), label="charge", delay=1800)
    while web.task(patrol)["progress"] < 0.4:
        page.wait_for_timeout(200)
    _save(page, "overview")

    page.set_viewport_size(TALL)
    page.click("text=Add a task…")
    page.select_option("select[name=kind]", "goto")
    page.fill("input[name=north]", "12.5")
    page.fill("input[name=east]", "3")
    page.fill("input[name=label]", "inspect the pump")
    _save(page, "add-task")

    page.click(".box >> text='Back'")
    page.set_viewport_size(SIZE)
    page.click("#stop-all")
    page.wait_for_selector("#stop-outcome >> text=standing")
    page.wait_for_selector(".card >> text=STOP is in force")
    page.click(".card >> text=Resume…")
    page.wait_for_selector(".box >> text=will drive")
    _save(page, "resume")


def _to(north: float, east: float, **others: float) -> dict[str, Any]:
    return {"kind": "goto", "north": north, "east": east} | others


def _save(page: Any, name: str) -> None:
    shot = Image.open(BytesIO(page.screenshot())).convert("RGB").quantize(COLOURS)
    shot.save(FOLDER / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main()
