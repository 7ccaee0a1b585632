"""Take the pictures of the web page that the guide shows, into mav_tasks/guide/images.

They show a real server and a simulated rover in a real Chromium, so each run's differ a little:
take them again when the page has changed, and look at them. `.venv/bin/python` runs this file.
"""

import sys
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from tests.kit import chromium  # noqa: E402
from tests.kit.web import Web, served  # noqa: E402

FOLDER = ROOT / "mav_tasks/guide/images"
TASKS: tuple[dict[str, Any], ...] = (
    {
        "label": "patrol",
        "goals": [{"kind": "goto", "north": 6, "east": 0}, {"kind": "goto", "north": 6, "east": 8}],
    },
    {"label": "to the gate", "goals": [{"kind": "goto", "north": 3, "east": -4}], "priority": 8},
    {"goals": [{"kind": "wait", "duration": 60}], "after": 1},
    {"label": "charge", "goals": [{"kind": "goto", "north": -4, "east": 3}], "delay": 1800},
)


def take(page: Any, web: Web) -> None:
    """Take all pictures."""

    def save(name: str) -> None:
        shot = Image.open(BytesIO(page.screenshot())).quantize(64)
        shot.save(FOLDER / f"{name}.png", optimize=True)

    page.goto(web.url)
    for task in TASKS:
        web.post("/vehicles/1/tasks", task)
    page.wait_for_timeout(26_000)  # then the rover is on its way to the second corner
    save("overview")

    page.click("text=Add a task…")
    save("add-task")

    page.keyboard.press("Escape")
    page.click("#stop-all")
    page.wait_for_selector("#stop-outcome >> text=standing")
    page.click(".card >> text=Resume…")
    page.wait_for_selector(".box >> text=will drive")
    save("resume")


if __name__ == "__main__":
    with TemporaryDirectory() as name, served(Path(name)) as (_, it), chromium.running() as browser:
        take(browser.new_page(viewport={"width": 1280, "height": 820}, locale="en-GB"), it)
