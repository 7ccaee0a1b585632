"""What the page says and does while a rover, the server or the web process is away."""

import signal
from collections.abc import Iterator
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from tests.browser.kit import judge, move, opened, press_resume, says
from tests.kit.processes import Process, Stand, process, stand, wait_until
from tests.kit.web import Web, has_rover, web

pytestmark = pytest.mark.slow

FAR = 4.0  # m; a rover drives on for a while when the server is gone
AWAY = 30_000  # ms, for a process to start again and be noticed
RELEASES = {
    "remainder": "The rover drives what is left of the task.",
    "again": "From where the rover is now, the whole task is driven again.",
    "skip": "The task ends as cancelled. The next task then starts.",
}


@pytest.fixture
def lost(tmp_path: Path) -> Iterator[tuple[Stand, Web]]:
    """A server, rover and web process of this test alone: it kills them."""
    store = str(tmp_path / "tasks.sqlite3")
    with stand(tmp_path, serve_store=store) as it, web(tmp_path, it, name="first") as page:
        has_rover(page)
        yield it, page


def serve_again(it: Stand, folder: Path, name: str = "again") -> AbstractContextManager[Process]:
    """Run the server once more, on the same ports and store."""
    return process(
        *("-m", "mav_tasks.cli", "serve", "--no-push", "--store", str(folder / "tasks.sqlite3")),
        *("--client", f"udpin:127.0.0.1:{it.client_port}"),
        *("--vehicle", f"udpout:127.0.0.1:{it.rover_port}"),
        folder=folder,
        name=name,
    )


def test_it_goes_on_after_the_server_and_the_web_process_were_killed(
    chromium: Any, lost: tuple[Stand, Web], tmp_path: Path, shots: Path
) -> None:
    it, first = lost
    port = first.url.rpartition(":")[2]
    with opened(chromium, first, may_fail=True) as page:
        page.evaluate("() => { window.isMarked = true; }")
        it.server.end(signal.SIGKILL)
        says(page, "#banner", "is it running? What you see may be old.")
        page.wait_for_selector(".rover-mark.old", state="attached")
        says(page, ".card.old", "the connection is lost.")
        judge(page, "no server")
        page.click("#stop-all")
        says(page, "#stop-outcome", "STOP not acknowledged: no answer within")
        says(page, "#stop-outcome", "Trying again. Use the rover's own switch.")
        page.screenshot(path=str(shots / "no server.png"))
        with serve_again(it, tmp_path):
            # nobody presses it again
            says(page, "#stop-outcome", "STOP: acknowledged")
            page.wait_for_selector("#banner", state="hidden", timeout=AWAY)
            says(page, ".card", "STOP is in force")
            first.resume()
            first.process.end(signal.SIGKILL)
            says(page, "#banner", "The connection to the web process is lost; trying again.")
            says(page, "#banner", "STOP is still sent when you press it.")
            page.wait_for_selector(".rover-mark.old", state="attached")
            page.click(".card .stop-small")
            says(
                page, "#stop-outcome", "STOP 1 not acknowledged: the web process cannot be reached."
            )
            says(page, "#stop-outcome", "Trying again.")
            page.screenshot(path=str(shots / "no web process.png"))
            with web(tmp_path, it, "--listen", f"127.0.0.1:{port}", name="second") as second:
                says(page, "#stop-outcome", "STOP 1: acknowledged")
                page.wait_for_selector("#banner", state="hidden", timeout=AWAY)
                page.wait_for_selector(".card:not(.old)")
                page.wait_for_selector(".rover-mark:not(.old)", state="attached")
                says(page, ".card", "STOP is in force")
                second.resume()
                task = move(second, 0.3)
                page.click("#tab-past")
                says(page, "#panel-past .task", f"Task {task['id']}: move 0.3 m")
                assert page.evaluate("window.isMarked")  # it was not loaded again


def test_tasks_that_the_servers_end_interrupted_are_released(
    chromium: Any, tmp_path: Path, shots: Path
) -> None:
    store, options = str(tmp_path / "tasks.sqlite3"), ("--count", str(len(RELEASES)))
    with (
        stand(tmp_path, serve_store=store, rover_options=options) as it,
        web(tmp_path, it) as shown,
        opened(chromium, shown, may_fail=True) as page,
    ):
        starts = [shown.get(f"/vehicles/{rover}")["north"] for rover in (1, 2, 3)]
        goal = {"kind": "move", "distance": FAR}
        tasks = {
            how: shown.post(f"/vehicles/{rover}/tasks", {"goals": [goal]})["id"]
            for rover, how in enumerate(RELEASES, 1)
        }
        after = shown.post("/vehicles/3/tasks", {"goals": [{"kind": "move", "distance": 0.2}]})
        for rover, start in enumerate(starts, 1):
            wait_until(partial(is_beyond, shown, rover, start), within=15, what="a moving rover")
        it.server.end(signal.SIGKILL)
        says(page, "#banner", "is it running?")
        with serve_again(it, tmp_path):
            page.wait_for_selector("#banner", state="hidden", timeout=AWAY)
            begins = {}
            for rover, how in enumerate(RELEASES, 1):
                page.click(f".card .pick >> text='Rover {rover}'")
                says(page, ".task.now", "⚠ held")
                page.click(".task.now >> text=Release…")
                page.select_option(".box [name=how]", how)
                says(page, ".box", RELEASES[how])
                if how == "remainder":
                    judge(page, "a release")
                    page.screenshot(path=str(shots / "release.png"))
                    shown.post(f"/vehicles/{rover}/pause", {})  # somebody halts it meanwhile
                    page.click(".box >> text='Release'")
                    says(page, ".box .failure", "Something halted the rover after this page was")
                    page.click(".box >> text='Back'")
                    page.click(".task.now >> text=Release…")
                    page.select_option(".box [name=how]", how)
                begins[how] = shown.get(f"/vehicles/{rover}")["north"]
                page.click(".box >> text='Release'")
                page.wait_for_selector(".box", state="detached")
                if how == "skip":  # it halts the rover once more: the page must know
                    page.wait_for_selector(".task.now", state="detached")
                if shown.get(f"/vehicles/{rover}/queue")["paused"]:
                    press_resume(page, ".notice")
            assert shown.wait_for(tasks["skip"], "cancelled")
            shown.wait_for(after["id"], "completed")
            says(page, "#panel-queue .what", "Rover 3: no task runs, 0 wait")
            driven = {}
            for rover, how in ((1, "remainder"), (2, "again")):
                shown.wait_for(tasks[how], "completed")
                driven[how] = shown.get(f"/vehicles/{rover}")["north"] - begins[how]
                page.click(f".card .pick >> text='Rover {rover}'")
                page.click("#tab-past")
                says(page, "#panel-past .task", f"Task {tasks[how]}: move {FAR:g} m")
                says(page, "#panel-past .task", "✓ completed")
            assert driven["again"] == pytest.approx(FAR, abs=0.2)
            assert 0 < driven["remainder"] < FAR - 0.2


def is_beyond(it: Web, rover: int, start: float) -> bool:
    """Return whether a rover has driven some way to the north."""
    return bool(it.get(f"/vehicles/{rover}")["north"] > start + 0.3)
