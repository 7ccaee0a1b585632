"""The web page in a real Chromium, on a real server and rover: each button and dialogue."""

import gzip
import re
import signal
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from mav_tasks import Move, SyncClient
from tests.browser.kit import DESKTOP, PHONE, opened, says, text_of
from tests.kit.processes import Stand, process, stand, wait_until
from tests.kit.web import Web, has_rover, web

axe_module = pytest.importorskip("axe_playwright_python.sync_playwright")

pytestmark = pytest.mark.slow

HOSTILE = "<img src=x onerror=boom>"  # as long as a label may be
LARGEST = 250_000  # bytes of the whole page, compressed
SERIOUS = ("serious", "critical")


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Stand, Web]]:
    """One server, rover and web process for all of them; each leaves the queue empty."""
    folder = tmp_path_factory.mktemp("browser")
    store = str(folder / "tasks.sqlite3")
    with (
        stand(folder, serve_store=store) as it,
        web(folder, it, "--store", store) as page,
    ):
        has_rover(page)
        yield it, page


@pytest.fixture
def it(both: tuple[Stand, Web]) -> Iterator[Web]:
    """The web process; afterwards nothing waits and nothing is paused."""
    web_process = both[1]
    yield web_process
    web_process.post("/stop", {"clear": True})

    def is_empty() -> bool:
        queue = web_process.get("/vehicles/1/queue")
        return not queue["running"] and not queue["waiting_count"]

    wait_until(is_empty, within=15, what="an empty queue")
    resume(web_process)


def resume(it: Web) -> None:
    it.post("/vehicles/1/resume", {"epoch": it.get("/vehicles/1/queue")["halt_epoch"]})


def add(it: Web, goal: dict[str, Any], **terms: Any) -> Any:
    return it.post("/vehicles/1/tasks", {"goals": [goal]} | terms)


def move(it: Web, metres: float, **terms: Any) -> Any:
    return add(it, {"kind": "move", "distance": metres}, **terms)


def test_a_new_user_finds_out_why_a_paused_task_does_not_run_and_gets_it_going(
    chromium: Any, it: Web, shots: Path
) -> None:
    it.post("/vehicles/1/pause", {})
    task = move(it, 0.5, label="to the gate")
    with opened(chromium, it) as page:
        says(page, ".card", "Rover 1 is paused: somebody paused it. Resume lets its tasks run.")
        says(page, ".notice", "No task runs: somebody paused it.")
        says(page, f"[data-task='{task['id']}']", "Waits: queue paused. Resume lets it run.")
        page.screenshot(path=str(shots / "1 paused.png"))
        page.click(".card >> text=Resume…")
        box = text_of(page, ".box")
        assert "Resume rover 1?" in box
        assert f"Rover 1 will drive: Task {task['id']} “to the gate”: move 0.5 m starts." in box
        page.screenshot(path=str(shots / "2 resume.png"))
        page.click(".box >> text='Resume'")
        page.wait_for_selector(f".task.now[data-task='{task['id']}']")
        page.screenshot(path=str(shots / "3 drives.png"))
        page.click("#tab-past")
        says(page, "#panel-past .task", "✓ completed")
        page.screenshot(path=str(shots / "4 done.png"))


@pytest.mark.parametrize("how", ["button", "key", "card"])
def test_stop_acts_at_once_and_says_what_came_of_it(
    chromium: Any, it: Web, shots: Path, how: str
) -> None:
    task = move(it, 9.0)
    it.wait_for(task["id"], "executing")
    with opened(chromium, it) as page:
        page.wait_for_selector(".task.now")
        if how == "key":
            page.keyboard.press("Shift+S")
        else:
            page.click("#stop-all" if how == "button" else ".card .stop-small")
        says(page, "#stop-outcome", "acknowledged")
        says(page, "#stop-outcome", "standing")
        says(page, "#stop-outcome", f"ended task {task['id']}")
        says(page, ".card", "STOP is in force. Resume ends it.")
        outcome = text_of(page, "#stop-outcome")
        assert re.search(r"acknowledged \d+ ms · standing [\d.]+ m?s", outcome)
        page.screenshot(path=str(shots / f"stop by {how}.png"))
    assert it.task(task["id"])["state"] == "killed"


def test_stop_says_what_came_of_it_without_the_event_stream(chromium: Any, it: Web) -> None:
    task = move(it, 9.0)
    it.wait_for(task["id"], "executing")
    with opened(chromium, it, waits=False, may_fail=True, before=without_events) as page:
        says(page, "#banner", "The connection to the web process is lost")
        page.click("#stop-all")
        says(page, "#stop-outcome", "STOP: acknowledged")
    assert it.wait_for(task["id"], "killed")


def without_events(page: Any) -> None:
    page.route("**/api/v1/events", lambda route: route.abort())


@pytest.mark.parametrize("hours", [-30, 30])
def test_the_clock_of_the_device_may_be_wrong(chromium: Any, it: Web, hours: int) -> None:
    task = move(it, 0.3)
    it.wait_for(task["id"], "completed")
    shifted = f"const now = Date.now; Date.now = () => now() + {hours} * 3600e3;"
    with opened(chromium, it, before=lambda page: page.add_init_script(shifted)) as page:
        page.wait_for_selector(f"#timeline .bar[title^='Task {task['id']}:']")
        page.click("#stop-all")
        says(page, "#stop-outcome", "STOP: acknowledged")
        says(page, "#stop-outcome", "standing")


def test_caps_lock_does_not_keep_the_key_from_stopping(chromium: Any, it: Web) -> None:
    with opened(chromium, it) as page:
        page.evaluate(
            "() => document.body.dispatchEvent(new KeyboardEvent('keydown',"
            " {key: 's', shiftKey: true, bubbles: true}))"
        )
        says(page, "#stop-outcome", "STOP: acknowledged")


@pytest.mark.parametrize("size", [DESKTOP, PHONE])
def test_a_dialogue_covers_neither_stop_nor_its_outcome(
    chromium: Any, it: Web, size: tuple[int, int]
) -> None:
    it.post("/vehicles/1/pause", {})
    with opened(chromium, it, size=size) as page:
        if size == PHONE:
            page.click("[data-show=side]")
        page.click("text=Add a task…")
        for _ in range(2):  # the outcomes make the bar higher
            page.click("#stop-all")
            says(page, "#stop-outcome", "standing")
        top, box = (page.locator(name).bounding_box() for name in (".top", ".box"))
        assert (top["x"], top["width"]) == (0, size[0])
        assert box["y"] >= top["y"] + top["height"]
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= size[0]
        assert page.evaluate("() => document.documentElement.scrollWidth") <= size[0]
        page.keyboard.press("Escape")
        page.click("#panel-queue >> text=Add a task…")  # what was below is in reach again


def test_stop_is_in_reach_above_a_dialogue(chromium: Any, it: Web, shots: Path) -> None:
    task = move(it, 9.0)
    it.wait_for(task["id"], "executing")
    with opened(chromium, it) as page:
        page.click("text=Add a task…")
        page.screenshot(path=str(shots / "add a task.png"))
        page.click("#stop-all")
        says(page, "#stop-outcome", "acknowledged")
        assert page.is_visible(".box")
        page.keyboard.press("Escape")
        page.wait_for_selector(".box", state="detached")
        assert page.evaluate("document.activeElement.textContent") != ""


def test_a_page_that_is_behind_cannot_release_a_newer_stop(chromium: Any, it: Web) -> None:
    it.post("/vehicles/1/pause", {})
    with opened(chromium, it, may_fail=True) as page:
        page.click(".card >> text=Resume…")
        it.post("/stop", {})
        page.click(".box >> text='Resume'")
        says(page, ".box .failure", "Something halted the rover after this page was drawn.")
    assert it.get("/vehicles/1/queue")["paused"] == "stopped"


GOALS = [
    ("move", {"distance": "0.3"}, "move 0.3 m"),
    ("rotate", {"angle": "20"}, "rotate 20 deg"),
    ("drive", {"forward": "0.2", "yaw_rate": "0", "duration": "1"}, "drive 0.2 m/s for 1 s"),
    ("goto", {"north": "1", "east": "0.5"}, "go to 1.00 m N, 0.50 m E"),
    ("goto_global", {"latitude": "-35.36326", "longitude": "149.16523"}, "go to -35.363260"),
    ("face", {"heading": "90"}, "face 90 deg"),
    ("wait", {"duration": "1"}, "wait 1 s"),
    ("home", {}, "return home"),
]


def test_tasks_of_every_kind_are_added_with_the_form(chromium: Any, it: Web) -> None:
    it.post("/vehicles/1/pause", {})
    with opened(chromium, it) as page:
        for kind, numbers, words in GOALS:
            page.click("text=Add a task…")
            page.select_option(".box [name=kind]", kind)
            for name, value in numbers.items():
                page.fill(f".box [name={name}]", value)
            page.fill(".box [name=label]", kind)
            says(page, ".box", "The queue is paused (somebody paused it)")
            page.click(".box >> text='Add the task'")
            page.wait_for_selector(".box", state="detached")
            says(page, "#panel-queue .task", f"“{kind}”: {words}")
    assert it.get("/vehicles/1/queue")["waiting_count"] == len(GOALS)


def test_the_form_says_what_is_wrong(chromium: Any, it: Web) -> None:
    with opened(chromium, it, may_fail=True) as page:
        page.click("text=Add a task…")
        page.click(".box >> text='Add the task'")
        says(page, ".box .failure", "distance: missing; expected distance")
        page.fill(".box [name=distance]", "1000000")
        page.click(".box >> text='Add the task'")
        says(page, ".box .failure", "param1 distance")
        page.click(".box >> text='Back'")
        page.wait_for_selector(".box", state="detached")


def test_priorities_by_buttons_and_by_dragging(chromium: Any, it: Web) -> None:
    it.post("/vehicles/1/pause", {})
    first, second, third = (move(it, 0.1 * n)["id"] for n in (1, 2, 3))
    with opened(chromium, it) as page:
        row = "#panel-queue [data-task='{}']"
        page.click(f"{row.format(second)} >> text=▲")
        says(page, row.format(second), "priority 6")
        page.wait_for_function(f"() => {ORDER}.join() === '{second},{first},{third}'")
        page.drag_and_drop(row.format(third), row.format(second))
        says(page, row.format(third), "priority 7")
        page.wait_for_function(f"() => {ORDER}.join() === '{third},{second},{first}'")
        page.click(f"{row.format(third)} >> text=▼")
        says(page, row.format(third), "priority 6")
        page.drag_and_drop(row.format(second), row.format(first))  # down: behind that one
        says(page, row.format(second), "priority 5")
        page.wait_for_function(f"() => {ORDER}.join() === '{third},{first},{second}'")
        it.send("PATCH", f"/tasks/{third}", {"priority": 10})
        it.send("PATCH", f"/tasks/{first}", {"priority": 10})
        says(page, row.format(first), "priority 10")
        page.drag_and_drop(row.format(third), row.format(first))
        says(page, "#panel-queue .failure", f"No priority puts task {third} before task {first}")


ORDER = "[...document.querySelectorAll('#panel-queue [data-task]')].map((e) => e.dataset.task)"


def test_tasks_are_cancelled_one_by_one_and_all(chromium: Any, it: Web) -> None:
    it.post("/vehicles/1/pause", {})
    first, *_ = (move(it, 0.1)["id"] for _ in range(3))
    with opened(chromium, it) as page:
        page.click(f"[data-task='{first}'] >> text=Cancel…")
        says(page, ".box", f"Cancel task {first}?")
        page.click(".box >> text='Cancel the task'")
        page.wait_for_selector(f"#panel-queue [data-task='{first}']", state="detached")
        page.click("text=Cancel all…")
        says(page, ".box", "2 tasks will be cancelled.")
        page.click(".box >> text='Cancel them'")
        says(page, "#panel-queue", "Nothing waits.")


PLAN = """{{"fileType": "Plan", "version": 1, "groundStation": "test",
"mission": {{"version": 2, "firmwareType": 3, "vehicleType": 10, "cruiseSpeed": 1, "hoverSpeed": 1,
"plannedHomePosition": [{0}, {1}, 0], "items": []}},
"geoFence": {{"version": 2, "polygons": [],
"circles": [{{"version": 1, "inclusion": true,
"circle": {{"center": [{0}, {1}], "radius": 40}}}}]}},
"rallyPoints": {{"version": 2, "points": [[{0}, {1}, 0]]}}}}"""


def test_a_fence_and_rally_points_of_a_file_are_set_and_removed(
    chromium: Any, it: Web, shots: Path
) -> None:
    it.post("/vehicles/1/pause", {})
    rover = it.get("/vehicles/1")
    text = PLAN.format(rover["latitude"], rover["longitude"])
    with opened(chromium, it) as page:
        drop(page, "fence.plan", text)
        says(page, ".box", "fence.plan has no mission.")
        says(page, ".box", "Set its fence (1 shape). It replaces the present fence")
        page.screenshot(path=str(shots / "fence of a plan.png"))
        page.click(".box >> text='Back'")
        assert it.get("/vehicles/1/fence")["shapes"] == []
        drop(page, "fence.plan", text)
        page.click(".box >> text='Set it'")
        page.wait_for_selector(".box", state="detached")
        (shape,) = it.get("/vehicles/1/fence")["shapes"]
        assert shape["radius"] == 40
        assert len(it.get("/vehicles/1/rally")["places"]) == 1
        page.focus("#map")
        page.keyboard.press("Enter")
        page.wait_for_selector(".leaflet-popup >> text=Remove its fence…")
        assert "Go here" in page.evaluate("() => document.activeElement.textContent")
        page.click(".leaflet-popup >> text=Remove its fence…")
        page.click(".box >> text='Remove the fence'")
        page.wait_for_selector(".box", state="detached")
        assert it.get("/vehicles/1/fence")["shapes"] == []


ITEM = "{}\t{}\t{}\t16\t0\t0\t0\t0\t{}\t{}\t0\t1\n"


def test_a_plan_is_dropped_looked_at_and_queued(
    chromium: Any, it: Web, shots: Path, tmp_path: Path
) -> None:
    it.post("/vehicles/1/pause", {})
    rover = it.get("/vehicles/1")
    places = [(rover["latitude"] + north * 1e-5, rover["longitude"]) for north in range(4)]
    rows = [ITEM.format(n, int(n == 0), 3 * (n > 0), *place) for n, place in enumerate(places)]
    plan = "QGC WPL 110\n" + "".join(rows)
    with opened(chromium, it, may_fail=True) as page:
        drop(page, f"{HOSTILE}.txt", plan)
        says(page, ".box", f"{HOSTILE}.txt: 3 items, 3 places")
        says(page, ".box", "the task waits until you resume")
        page.screenshot(path=str(shots / "plan.png"))
        assert it.get("/vehicles/1/queue")["waiting_count"] == 0  # nothing was sent yet
        page.click(".box >> text='Queue the plan'")
        says(page, "#panel-queue .task", "plan of 3 items")
        says(page, "#panel-queue .task", f"“{HOSTILE}”: plan of 3 items")
        drop(page, "wrong.plan", "nothing")
        says(page, ".drop .failure", "wrong.plan: ")
        path = tmp_path / "chosen.txt"
        path.write_text(plan)
        page.set_input_files("#plan-file", path)
        says(page, ".box", "chosen.txt: 3 items")


def drop(page: Any, name: str, text: str) -> None:
    """Drop a file on the page, as a person does from a file manager."""
    transfer = page.evaluate_handle(
        "([name, text]) => { const all = new DataTransfer();"
        " all.items.add(new File([text], name, {type: 'text/plain'})); return all; }",
        [name, text],
    )
    page.dispatch_event(".drop", "dragover", {"dataTransfer": transfer})
    page.dispatch_event(".drop", "drop", {"dataTransfer": transfer})


def test_a_click_on_the_map_sends_turns_and_fences(chromium: Any, it: Web, shots: Path) -> None:
    it.post("/vehicles/1/pause", {})
    with opened(chromium, it) as page:
        for word, title, button, shown in (
            ("Go here", "Send rover 1 here", "Add the task", "go to"),
            ("Face here", "Turn rover 1 to", "Add the task", "face"),
        ):
            page.click("#map", position={"x": 420, "y": 200})
            page.click(f".leaflet-popup >> text={word}")
            says(page, ".box h2", title)
            page.click(f".box >> text='{button}'")
            says(page, "#panel-queue .task", shown)
        page.click("#map", position={"x": 420, "y": 200})
        page.screenshot(path=str(shots / "map click.png"))
        page.click(".leaflet-popup >> text=Fence here")
        says(page, ".box", "This replaces its present fence.")
        page.fill(".box [name=radius]", "30")
        page.click(".box >> text='Set the fence'")
        page.wait_for_selector(".box", state="detached")
        (shape,) = it.get("/vehicles/1/fence")["shapes"]
        assert shape["radius"] == 30
    it.send("DELETE", "/vehicles/1/fence", None)


def test_a_task_has_a_permalink_with_journal_and_timing(chromium: Any, it: Web) -> None:
    task = move(it, 0.4)
    it.wait_for(task["id"], "completed")
    with opened(chromium, it, path=f"/tasks/{task['id']}") as page:
        says(page, "#panel-past h2", f"Task {task['id']}: move 0.4 m")
        says(page, "#panel-past dd", "intervals at 20 Hz")
        says(page, "#panel-past .log li", "completed")
        page.click("text=← Back to the list")
        assert page.url == f"{it.url}/"
        page.go_back()
        says(page, "#panel-past h2", f"Task {task['id']}")
        page.click("#tab-texts")
        page.fill("#panel-texts [type=search]", f"task {task['id']}")
        says(page, "#panel-texts .log li", f"Task {task['id']}")
        page.select_option("#panel-texts select >> nth=0", "journal")
        says(page, "#panel-texts .log li", "completed")
    with opened(chromium, it, path="/tasks/987654", may_fail=True) as page:
        says(page, "#panel-past .failure", "No task 987654")


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
        page.focus(f"#timeline .bar[title^='Task {task['id']}:']")
        page.keyboard.press("Enter")
        says(page, "#panel-past h2", f"Task {task['id']}")


def test_hostile_words_are_only_words(chromium: Any, it: Web) -> None:
    it.post("/vehicles/1/pause", {})
    task = move(it, 0.1, label=HOSTILE)
    with opened(chromium, it, path=f"/tasks/{task['id']}") as page:
        says(page, "#panel-past h2", HOSTILE)
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
    axe = axe_module.Axe()
    with opened(chromium, it, size=size, scheme=scheme) as page:
        for view in ("rovers", "map", "side") if size == PHONE else ("",):
            if view:
                page.click(f"[data-show={view}]")
            for tab in ("past", "texts", "queue") if view in ("", "side") else ("",):
                if tab:
                    page.click(f"#tab-{tab}")
                judge(axe, page, f"{view} {tab}")
            page.screenshot(path=str(shots / f"{scheme} {size[0]} {view}.png"))
        page.click("text=Add a task…")
        judge(axe, page, "dialogue")
        page.screenshot(path=str(shots / f"{scheme} {size[0]} dialogue.png"))


def judge(axe: Any, page: Any, where: str) -> None:
    found = axe.run(page).response["violations"]
    serious = [each for each in found if each["impact"] in SERIOUS]
    words = [(each["id"], [node["html"] for node in each["nodes"]][:3]) for each in serious]
    assert not words, (where, words)


def test_the_whole_page_is_small_and_soon_there(chromium: Any, it: Web) -> None:
    with opened(chromium, it) as page:
        page.wait_for_function(f"() => {PAINTS}.length === 1")
        urls = page.evaluate("performance.getEntriesByType('resource').map((each) => each.name)")
    files = {url for url in urls if not url.endswith("/events")} | {f"{it.url}/"}
    sizes = {url: len(gzip.compress(it.client.get(url).content)) for url in files}
    assert len(sizes) > 20
    assert sum(sizes.values()) < LARGEST, sizes


PAINTS = "performance.getEntriesByName('first-contentful-paint')"


def test_it_goes_on_after_the_web_process_and_the_server_were_killed(
    chromium: Any, tmp_path: Path, shots: Path
) -> None:
    store = str(tmp_path / "tasks.sqlite3")
    serve = ("-m", "mav_tasks.cli", "serve", "--no-push", "--store", store)
    with stand(tmp_path, serve_store=store) as both_of_them:
        client_port = both_of_them.client_port
        ends = ["--client", f"udpin:127.0.0.1:{client_port}"]
        ends += ["--vehicle", f"udpout:127.0.0.1:{both_of_them.rover_port}"]
        with web(tmp_path, both_of_them, name="first") as it:
            has_rover(it)
            port = it.url.rpartition(":")[2]
            with opened(chromium, it, may_fail=True) as page:
                both_of_them.server.end(signal.SIGKILL)
                says(page, "#banner", "is it running? What you see may be old.")
                page.screenshot(path=str(shots / "no server.png"))
                page.click("#stop-all")
                says(page, "#stop-outcome", "not acknowledged")
                with process(*serve, *ends, folder=tmp_path, name="again"):
                    page.wait_for_selector("#banner", state="hidden", timeout=30_000)
                    it.process.end(signal.SIGKILL)
                    says(page, "#banner", "The connection to the web process is lost")
                    says(page, "#banner", "STOP is still sent when you press it.")
                    page.screenshot(path=str(shots / "no web process.png"))
                    page.click("#stop-all")
                    says(page, "#stop-outcome", "Trying again.")
                    command = ("--listen", f"127.0.0.1:{port}")
                    with web(tmp_path, both_of_them, *command, name="second") as second:
                        page.wait_for_selector("#banner", state="hidden", timeout=30_000)
                        says(page, "#stop-outcome", "STOP: acknowledged")
                        assert "not acknowledged" not in text_of(page, "#stop-outcome")
                        says(page, ".card", "STOP is in force")
                        resume(second)
                        task = move(second, 0.3)
                        page.click("#tab-past")
                        says(page, "#panel-past .task", f"Task {task['id']}: move 0.3 m")


def test_a_token_opens_the_page_and_its_revocation_closes_it(
    chromium: Any, both: tuple[Stand, Web], tmp_path: Path, shots: Path
) -> None:
    command = ("-m", "mav_tasks.cli", "web", "tokens")
    file = ("--tokens", str(tmp_path / "web-tokens.json"))
    with web(tmp_path, both[0], "--role", "", name="closed") as it:
        add_one = (*command, "add", "anna", "--role", "observer", *file)
        with process(*add_one, folder=tmp_path, name="add") as adding:
            assert adding.popen.wait(20) == 0
            token = adding.text.strip()
        with opened(chromium, it, waits=False, may_fail=True) as page:
            page.fill(".box [name=token]", "wrong")
            page.click(".box [type=submit]")
            says(page, ".box .failure", "There is no such token")
            page.screenshot(path=str(shots / "log in.png"))
            page.fill(".box [name=token]", token)
            page.click(".box [type=submit]")
            page.wait_for_selector(".card")
            says(page, "#link", "you: anna, observer")
            assert page.is_visible("#stop-all")
            assert not page.is_visible("text=Add a task…")  # an observer's page
            revoke_one = (*command, "revoke", "anna", *file)
            with process(*revoke_one, folder=tmp_path, name="revoke") as revoking:
                assert revoking.popen.wait(20) == 0
            page.click("#stop-all")
            says(page, "#stop-outcome", "a token is required")


def test_twenty_rovers_and_a_thousand_tasks(chromium: Any, tmp_path: Path, shots: Path) -> None:
    options = ("--count", "20")
    with stand(tmp_path, rover_options=options) as both_of_them, web(tmp_path, both_of_them) as it:
        wait_until(lambda: len(it.get("/vehicles")["vehicles"]) == 20, within=30, what="20 rovers")
        for rover in range(1, 21):
            wait_until(partial(paused, it, rover), within=10, what="a pause")
        submit_all(both_of_them.client_port)
        with opened(chromium, it) as page:
            page.wait_for_function("() => document.querySelectorAll('.card').length === 20")
            page.wait_for_function("() => document.querySelectorAll('.rover-mark').length === 20")
            page.click(".card >> nth=6 >> .pick")
            says(page, "#panel-queue .what", "Rover 7: no task runs, 50 wait")
            assert page.is_visible("#stop-one")
            page.screenshot(path=str(shots / "twenty rovers.png"))
            page.click("#stop-one")
            says(page, "#stop-outcome", "STOP 7: acknowledged")


def paused(it: Web, rover: int) -> bool:
    return it.send("POST", f"/vehicles/{rover}/pause", {}).status_code == 204


def submit_all(port: int) -> None:
    url = f"udpout:127.0.0.1:{port}"
    for half in (0, 10):  # one client may have 500 waiting tasks
        with SyncClient(url, system_id=100 + half) as client:
            for rover in range(half + 1, half + 11):
                for _ in range(50):
                    client.submit(Move(0.1), vehicle=rover)
