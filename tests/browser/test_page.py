"""Steering by the web page in a real Chromium, on a real rover: each button and dialogue."""

import re
from pathlib import Path
from typing import Any

import pytest

from tests.browser.kit import (
    DESKTOP,
    HOSTILE,
    PHONE,
    judge,
    move,
    opened,
    press_resume,
    says,
    text_of,
)
from tests.kit.web import Web

pytestmark = pytest.mark.slow


def test_a_new_user_finds_out_why_a_paused_task_does_not_run_and_gets_it_going(
    chromium: Any, it: Web, shots: Path
) -> None:
    it.post("/vehicles/1/pause", {})
    task = move(it, 0.5, label="to the gate")
    with opened(chromium, it) as page:
        says(page, ".card", "Rover 1 is paused: somebody paused it. To let it run, press Resume.")
        says(page, ".notice", "No task runs: somebody paused it.")
        says(
            page, f"[data-task='{task['id']}']", "Waits: queue paused. To let it run, press Resume."
        )
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
        says(page, ".card", "STOP is in force. To let it run, press Resume.")
        outcome = text_of(page, "#stop-outcome")
        assert re.search(r"acknowledged [\d.]+ m?s · standing [\d.]+ m?s", outcome)
        page.screenshot(path=str(shots / f"stop by {how}.png"))
        it.resume()
        page.wait_for_function("() => !document.getElementById('stop-outcome').textContent")
    assert it.task(task["id"])["state"] == "killed"


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
        page.wait_for_function(BELOW)  # it makes room in the next frame
        top, box = (page.locator(name).bounding_box() for name in (".top", ".box"))
        assert (top["x"], top["width"]) == (0, size[0])
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= size[0]
        assert page.evaluate("() => document.documentElement.scrollWidth") <= size[0]
        page.keyboard.press("Escape")
        page.click("#panel-queue >> text=Add a task…")  # what was below is in reach again


BELOW = """() => { const [box, top] = ['.box', '.top'].map(
    (each) => document.querySelector(each).getBoundingClientRect());
    return box.top >= top.bottom; }"""


def test_stop_is_in_reach_above_a_dialogue(chromium: Any, it: Web, shots: Path) -> None:
    task = move(it, 9.0)
    it.wait_for(task["id"], "executing")
    with opened(chromium, it) as page:
        page.click("text=Add a task…")
        page.screenshot(path=str(shots / "add a task.png"))
        with page.expect_response("**/api/v1/stop"):
            page.click("#stop-all")
        says(page, "#stop-outcome", "STOP: acknowledged")
        assert page.is_visible(".box")
        stops = len(next(it.events())[2]["stops"])
        page.focus(".box [name=label]")
        page.keyboard.press("Shift+S")  # a letter of the name
        assert page.input_value(".box [name=label]") == "S"
        for name in ("distance", "kind"):
            page.focus(f".box [name={name}]")
            with page.expect_response("**/api/v1/stop"):
                page.keyboard.press("Shift+S")
        assert len(next(it.events())[2]["stops"]) == stops + 2
        page.keyboard.press("Escape")
        page.wait_for_selector(".box", state="detached")
        assert page.evaluate(FOCUSED) == "Add a task…"


FOCUSED = "document.activeElement.textContent.trim()"


def test_each_button_for_pause_and_resume(chromium: Any, it: Web) -> None:
    task = move(it, 3.0)
    it.wait_for(task["id"], "executing")
    with opened(chromium, it, may_fail=True) as page:
        for pause, resume_by in ((".card", "#panel-queue .notice"), (".task.now", ".card")):
            page.click(f"{pause} >> text=Pause")
            says(page, ".card", "Rover 1 is paused: somebody paused it.")
            says(page, "#panel-queue .what", f"Rover 1: task {task['id']} is paused, 0 wait")
            press_resume(
                page, resume_by, f"Rover 1 will drive: Task {task['id']}: move 3 m goes on."
            )
            says(page, "#panel-queue .what", f"Rover 1: task {task['id']} runs, 0 wait")


def test_a_page_that_is_behind_cannot_release_a_newer_stop(chromium: Any, it: Web) -> None:
    it.post("/vehicles/1/pause", {})
    with opened(chromium, it, may_fail=True) as page:
        page.click(".card >> text=Resume…")
        it.post("/stop", {})
        page.click(".box >> text='Resume'")
        says(page, ".box .failure", "Something halted the rover after this page was drawn.")
    assert it.get("/vehicles/1/queue")["paused"] == "stopped"


GOALS = """move distance=0.3: move 0.3 m
rotate angle=20: rotate 20 deg
drive forward=0.2 yaw_rate=0 duration=1: drive 0.2 m/s for 1 s
goto north=1 east=0.5: go to 1.00 m N, 0.50 m E
goto_global latitude=-35.36326 longitude=149.16523: go to -35.363260
face heading=90: face 90 deg
wait duration=1: wait 1 s
act command=relay-on param1=2: act relay-on
home: return home"""


def test_tasks_of_every_kind_are_added_with_the_form(chromium: Any, it: Web) -> None:
    it.post("/vehicles/1/pause", {})
    with opened(chromium, it) as page:
        for goal, words in re.findall("(.*): (.*)", GOALS):
            kind, *numbers = goal.split()
            page.click("text=Add a task…")
            page.select_option(".box [name=kind]", kind)
            for name, value in (number.split("=") for number in numbers):
                page.fill(f".box [name={name}]", value)
            page.fill(".box [name=label]", kind)
            says(page, ".box", "The queue is paused (somebody paused it)")
            page.click(".box >> text='Add the task'")
            page.wait_for_selector(".box", state="detached")
            says(page, "#panel-queue .task", f"“{kind}”: {words}")
    assert it.get("/vehicles/1/queue")["waiting_count"] == 9


def test_order_by_arrows_and_by_dragging_leaves_priorities_alone(chromium: Any, it: Web) -> None:
    it.post("/vehicles/1/pause", {})
    first, second, third = (move(it, 0.1 * n, priority=n)["id"] for n in (5, 4, 3))
    later = move(it, 1, delay=600)["id"]
    with opened(chromium, it) as page:
        row = "#panel-queue [data-task='{}']"

        def runs(*ids: int) -> None:
            page.wait_for_function(f"() => {ORDER}.join() === '{','.join(map(str, ids))},{later}'")

        page.focus(f"{row.format(third)} >> text=▲")
        page.keyboard.press("Enter")
        runs(first, third, second)
        assert page.evaluate(FOCUSED) == "▲"  # though its row has moved
        page.drag_and_drop(row.format(second), row.format(first))
        runs(second, first, third)
        page.click(f"{row.format(second)} >> text=▼")
        runs(first, second, third)
        page.drag_and_drop(row.format(first), row.format(third))  # down: behind that one
        runs(second, third, first)
        assert page.is_disabled(f"{row.format(second)} >> text=▲")
        assert page.is_disabled(f"{row.format(first)} >> text=▼")
        assert not page.is_visible(f"{row.format(later)} >> text=▲")  # it waits for its time
    assert [it.task(each)["priority"] for each in (first, second, third)] == [5, 4, 3]


def test_a_waiting_task_is_changed(chromium: Any, it: Web, shots: Path) -> None:
    it.post("/vehicles/1/pause", {})
    first, second = move(it, 0.1)["id"], move(it, 0.2, every=60)["id"]
    with opened(chromium, it) as page:
        page.click(f"#panel-queue [data-task='{second}'] a")
        page.click("#panel-task >> text=Change…")
        for name, value in (("label", "night"), ("priority", "7"), ("after", str(first))):
            page.fill(f".box [name={name}]", value)
        page.fill(".box [name=every]", "")
        page.fill(".box [name=deadline]", "7200")
        page.screenshot(path=str(shots / "change a task.png"))
        page.click(".box >> text='Change it'")
        says(page, "#panel-task h2", "“night”: move 0.2 m")
        says(page, "#panel-task .log li", "deadline")
        task = it.task(second)
        assert (task["priority"], task["after"], task["every"]) == (7, first, None)
        page.click("#panel-task >> text=Change…")
        page.fill(".box [name=after]", "")
        page.fill(".box [name=cron]", "30 7 * * 1-5 Europe/Berlin")
        page.click(".box >> text='Change it'")
        page.wait_for_selector(".box", state="detached")
        task = it.task(second)
        assert (task["after"], task["cron"]) == (None, "30 7 * * 1-5 Europe/Berlin")
        page.click("#tab-queue")
        says(page, f"#panel-queue [data-task='{second}']", "repeats at 30 7")


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


def test_the_running_task_is_cancelled_or_killed(chromium: Any, it: Web, shots: Path) -> None:
    with opened(chromium, it) as page:
        for how, state in (("cancel", "cancelled"), ("kill", "killed")):
            task, after = move(it, 9.0)["id"], move(it, 0.1)["id"]
            page.click(f".task.now[data-task='{task}'] >> text=Cancel…")
            says(page, ".box", "The rover slows down and stops; the task ends once it stands.")
            page.select_option(".box [name=how]", how)
            if how == "kill":
                says(page, ".box", "The task ends at once, without waiting until the rover stands.")
                says(page, ".box", "The queue is not paused: the next task starts once the rover")
                judge(page, "a kill")
                page.screenshot(path=str(shots / "kill.png"))
            page.click(f".box >> text='{how.capitalize()} the task'")
            page.wait_for_selector(".box", state="detached")
            it.wait_for(after, "completed")  # as the dialogue said
            assert it.task(task)["state"] == state


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
        judge(page, "a plan")
        page.screenshot(path=str(shots / "plan.png"))
        box = page.locator(".box").bounding_box()
        shown = page.locator("#map").bounding_box()
        assert box["x"] > shown["x"] + shown["width"] / 2  # the plan on the map is not covered
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
