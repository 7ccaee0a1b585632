"""What the web page shows in a real Chromium: one task, the time line, its rights, its looks."""

import gzip
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.browser.kit import HOSTILE, PHONE, judge, move, opened, says, text_of
from tests.kit.commands import called
from tests.kit.processes import Stand, frozen
from tests.kit.web import Web, add_key, ring_of, web

pytestmark = pytest.mark.slow

LARGEST = 250_000  # bytes of the whole page, compressed


def test_stop_says_what_came_of_it_without_the_event_stream(chromium: Any, it: Web) -> None:
    task = move(it, 9.0)
    it.wait_for(task["id"], "executing")
    with opened(chromium, it, waits=False, may_fail=True, before=without_events) as page:
        says(page, "#banner", "The connection to the web process is lost")
        page.click("#stop-all")
        says(page, "#stop-outcome", "STOP: acknowledged")
    assert it.wait_for(task["id"], "killed")


def test_a_stream_that_goes_quiet_is_lost_after_15_s(chromium: Any, it: Web, shots: Path) -> None:
    with opened(chromium, it, before=lambda page: page.clock.install()) as page:
        page.wait_for_selector(".card:not(.old)")
        page.clock.pause_at(page.evaluate("Date.now() / 1000 + 1"))
        with frozen(it.process):  # its connections stay open
            page.clock.run_for(14_000)
            assert not page.is_visible("#banner"), text_of(page, "#banner")
            page.clock.run_for(4_000)
            says(page, "#banner", "The connection to the web process is lost; trying again.")
            says(page, "#banner", "What you see is 1")
            says(page, "#link", "no connection")
            says(page, ".card.old", "link unknown")
            says(page, ".card.old", "position is 1")
            assert page.query_selector(".rover-mark.old")
            page.screenshot(path=str(shots / "quiet.png"))
        page.clock.resume()
        page.wait_for_selector("#banner", state="hidden")
        page.wait_for_selector(".card:not(.old)")


def without_events(page: Any) -> None:
    page.route("**/api/v1/events", lambda route: route.abort())


def test_the_clock_of_the_device_may_be_wrong(chromium: Any, it: Web) -> None:
    task = move(it, 0.3)
    it.wait_for(task["id"], "completed")
    for hours in (-30, 30):
        with opened(chromium, it, before=shifted_by(hours)) as page:
            page.wait_for_selector(f"#timeline .bar[title^='Task {task['id']}:']")
            page.click("#stop-all")
            says(page, "#stop-outcome", "STOP: acknowledged")
            says(page, "#stop-outcome", "standing")


def shifted_by(hours: int) -> Callable[[Any], None]:
    """Return what shifts a page's clock before it loads."""
    shifted = f"const now = Date.now; Date.now = () => now() + {hours} * 3600e3;"
    return lambda page: page.add_init_script(shifted)


def test_a_task_has_a_permalink_with_journal_and_timing(chromium: Any, it: Web) -> None:
    task = move(it, 0.4)
    it.wait_for(task["id"], "completed")
    with opened(chromium, it, path=f"/tasks/{task['id']}") as page:
        says(page, "#panel-task h2", f"Task {task['id']}: move 0.4 m")
        says(page, "#panel-task dd", "intervals at 20 Hz")
        says(page, "#panel-task .log li", "completed")
        judge(page, "one task")
        page.click("text=← Back to the list")
        assert page.url == f"{it.url}/"
        page.go_back()
        says(page, "#panel-task h2", f"Task {task['id']}")
        page.click("#tab-texts")
        page.fill("#panel-texts [type=search]", f"task {task['id']}")
        says(page, "#panel-texts .log li", f"Task {task['id']}")
        page.select_option("#panel-texts select >> nth=0", "journal")
        says(page, "#panel-texts .log li", "completed")
    with opened(chromium, it, path="/tasks/987654", may_fail=True) as page:
        says(page, "#panel-task .failure", "No task 987654")


def test_tabs_and_the_time_line_work_by_keyboard(chromium: Any, it: Web) -> None:
    task = move(it, 0.3)
    it.wait_for(task["id"], "completed")
    with opened(chromium, it) as page:
        page.focus("#tab-queue")
        page.keyboard.press("ArrowRight")
        assert page.evaluate("document.activeElement.id") == "tab-past"
        page.keyboard.press("ArrowRight")
        assert page.evaluate("document.activeElement.id") == "tab-texts"
        page.keyboard.press("ArrowRight")
        assert page.is_visible("#panel-queue")
        page.focus("#timeline select")
        page.keyboard.press("Tab")
        page.keyboard.press("ArrowRight")  # from the buttons to the bars
        assert page.evaluate("document.activeElement.title").startswith(f"Task {task['id']}:")
        page.keyboard.press("Enter")
        says(page, "#panel-task h2", f"Task {task['id']}")


def test_hostile_words_are_only_words(chromium: Any, it: Web) -> None:
    it.post("/vehicles/1/pause", {})
    task = move(it, 0.1, label=HOSTILE)
    with opened(chromium, it, path=f"/tasks/{task['id']}") as page:
        says(page, "#panel-task h2", HOSTILE)
        page.click("#tab-queue")
        says(page, "#panel-queue .task", HOSTILE)
        assert page.query_selector("img[src=x]") is None


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("size", [(1280, 800), PHONE])
def test_axe_finds_nothing_serious(
    chromium: Any, it: Web, shots: Path, size: tuple[int, int], scheme: str
) -> None:
    it.post("/vehicles/1/pause", {})
    move(it, 0.1, label="first")
    move(it, 0.1)
    with opened(chromium, it, size=size, scheme=scheme) as page:
        for view in ("rovers", "map", "side") if size == PHONE else ("",):
            if view:
                page.click(f"[data-show={view}]")
            for tab in ("past", "texts", "queue") if view in ("", "side") else ("",):
                if tab:
                    page.click(f"#tab-{tab}")
                judge(page, f"{view} {tab}")
            page.screenshot(path=str(shots / f"{scheme} {size[0]} {view}.png"))
        page.click("text=Add a task…")
        judge(page, "dialogue")
        page.screenshot(path=str(shots / f"{scheme} {size[0]} dialogue.png"))


def test_the_whole_page_is_small_and_soon_there(chromium: Any, it: Web) -> None:
    with opened(chromium, it) as page:
        page.wait_for_function(f"() => {PAINTS}.length === 1")
        urls = page.evaluate("performance.getEntriesByType('resource').map((each) => each.name)")
    files = {url for url in urls if not url.endswith("/events")} | {f"{it.url}/"}
    sizes = {url: len(gzip.compress(it.client.get(url).content)) for url in files}
    assert len(sizes) > 20
    assert sum(sizes.values()) < LARGEST, sizes


PAINTS = "performance.getEntriesByName('first-contentful-paint')"


def log_in(page: Any, token: str) -> None:
    """Enter a token where the page asks for one."""
    page.fill(".box [name=token]", token)
    page.click(".box [type=submit]")


def test_a_token_opens_the_page_and_its_revocation_closes_it(
    chromium: Any, both: tuple[Stand, Web], tmp_path: Path, shots: Path
) -> None:
    token = add_key(tmp_path, "anna", "observer")
    with (
        web(tmp_path, both[0], name="closed") as it,
        opened(chromium, it, waits=False, may_fail=True) as page,
    ):
        page.keyboard.press("Escape")  # there is no way around it
        assert not page.is_visible(".box >> text=Back")
        page.fill(".box [name=token]", "wrong")
        page.click(".box [type=submit]")
        says(page, ".box .failure", "There is no such token")
        judge(page, "log in")
        page.screenshot(path=str(shots / "log in.png"))
        log_in(page, token)
        page.wait_for_selector(".card")
        says(page, "#link", "you: anna, observer")
        assert page.is_visible("#stop-all")
        for offer in ("Add a task…", "Drop a .plan", "Click the map", "press Resume"):
            assert not page.is_visible(f"text={offer}"), offer  # an observer's page
        assert called("keys", "revoke", "anna", "--keys", str(ring_of(tmp_path))).status == 0
        says(page, ".box", "This page needs a token.")  # the stream of events has ended
        page.click("#stop-all")
        says(page, "#stop-outcome", "STOP not acknowledged: a token is required")
