"""The HTTP API of a real web process, beside a real server and rover."""

import json
import re
import shlex
import subprocess
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import groupby
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from aiopenapi3 import OpenAPI

from tests.kit.awaited import awaited
from tests.kit.processes import Stand, wait_until
from tests.kit.web import Web, add_key, served, web

pytestmark = pytest.mark.slow

DOCUMENT = Path(__file__).parents[1] / "golden/openapi.json"


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Stand, Web]]:
    """One server, rover and web process for all of them; each leaves the queue empty."""
    with served(tmp_path_factory.mktemp("web")) as it:
        yield it


@pytest.fixture
def page(both: tuple[Stand, Web]) -> Iterator[Web]:
    """The web process; afterwards nothing waits and nothing is paused."""
    yield both[1]
    both[1].empty()


def move(it: Web, metres: float, **more: Any) -> Any:
    return it.post("/vehicles/1/tasks", {"goals": [{"kind": "move", "distance": metres}]} | more)


Check = Callable[[str, Any], None]


@pytest.fixture
def check(page: Web) -> Check:
    """Return what fails unless a value is as the OpenAPI document says."""
    schemas = page.get("/openapi.json")["components"]["schemas"]

    def validate(name: str, value: Any) -> None:
        jsonschema.validate(value, schemas[name] | {"components": {"schemas": schemas}})

    return validate


def test_a_task_is_submitted_followed_and_driven(page: Web, check: Check) -> None:
    task = move(page, 0.4, label="to the gate", priority=7)
    check("Task", task)
    assert (task["what"], task["label"], task["priority"]) == ("move 0.4 m", "to the gate", 7)
    done = page.wait_for(task["id"], "completed")
    check("Task", done)
    track = page.get(f"/tasks/{task['id']}/track")
    check("Track", track)
    assert len(track["points"]) > 2
    timing = page.get(f"/tasks/{task['id']}/timing")
    check("Timing", timing)
    assert timing["count"] > 5
    journal = f"/tasks/{task['id']}/journal"  # on a slow disk the end is told before it is stored
    wait_until(lambda: "completed" in str(page.get(journal)), within=5)
    check("Entries", page.get(journal))
    history = page.get("/vehicles/1/history")
    check("Tasks", history)
    assert history["tasks"][0]["id"] == task["id"]
    assert history["tasks"][0]["ended_at"] is not None


SHOWN = """Session /session
Vehicles /vehicles
Vehicle /vehicles/1
Queue /vehicles/1/queue
Tasks /vehicles/1/history
Defaults /vehicles/1/defaults
Track /vehicles/1/track
Path /vehicles/1/mission
Fence /vehicles/1/fence
Places /vehicles/1/rally
Task /tasks/{}
Texts /texts
Entries /journal?limit=20"""


def test_answers_are_as_the_document_says(page: Web, check: Check) -> None:
    assert page.get("/openapi.json") == json.loads(DOCUMENT.read_text())
    later = move(page, 1.0, delay=1000)
    for row in SHOWN.splitlines():
        name, path = row.split()
        check(name, page.get(path.format(later["id"])))


def test_one_key_makes_one_task(page: Web) -> None:
    body = {"goals": [{"kind": "wait", "duration": 900}], "label": "once"}
    first = page.post("/vehicles/1/tasks", body, idempotency_key="a key")
    same = body | {"priority": 5, "delay": 0, "every": 0}
    again = page.post("/vehicles/1/tasks", same, idempotency_key="a key")
    assert first["id"] == again["id"]
    for other in ({"label": "twice"}, {"priority": 6}, {"every": 60}):
        refused = page.send("POST", "/vehicles/1/tasks", body | other, idempotency_key="a key")
        assert refused.status_code == 409
        assert refused.json()["reason"] == "nonce_reused"
    second = page.post("/vehicles/1/tasks", body, idempotency_key="another key")
    assert second["id"] != first["id"]
    long = page.send("POST", "/vehicles/1/tasks", body, idempotency_key="x" * 300)
    assert "expected 1 to" in long.json()["detail"]


def test_why_a_task_waits_and_what_helps(page: Web, check: Check) -> None:
    page.post("/vehicles/1/pause", {})
    task = move(page, 0.3)
    queue = page.get("/vehicles/1/queue")
    check("Queue", queue)
    assert queue["paused"] == "operator"
    assert queue["paused_words"] == "somebody paused it"
    assert queue["waiting"][0]["id"] == task["id"]
    assert queue["waiting"][0]["why"] == "queue paused"
    assert queue["waiting"][0]["remedy"] == {
        "action": "resume",
        "words": "To let it run, press Resume.",
    }
    wait_until(lambda: page.get("/vehicles/1")["control"] == "paused", within=5)
    line = 'mav_tasks_tasks{vehicle="1",state="queued",reason="queue_paused"} 1'
    wait_until(lambda: line in page.client.get("/metrics").text, within=10, what=line)
    page.resume()
    page.wait_for(task["id"], "completed")


def test_a_stop_says_what_came_of_it(page: Web, check: Check) -> None:
    task = move(page, 9.0)
    page.wait_for(task["id"], "executing")
    stream = page.events()
    assert next(stream)[0] == "snapshot"
    stop = page.post("/stop", {})
    check("Stop", stop)
    assert stop["phase"] == "acknowledged"
    seen = []
    for kind, _, data in stream:
        if kind == "stop" and data["number"] == stop["number"]:
            check("Stop", data)
            seen.append(data)
            if data["phase"] == "standing" and data["tasks"]:
                break
    phases = [phase for phase, _ in groupby(each["phase"] for each in seen)]  # some come twice
    assert phases[:2] == ["sent", "acknowledged"]
    assert seen[-1]["tasks"] == [task["id"]]
    assert 0 < seen[-1]["standing_after"] < 30
    with ThreadPoolExecutor(20) as pool:  # somebody presses STOP again and again
        stops = list(pool.map(lambda _: page.post("/stop", {}), range(60)))
    assert {each["phase"] for each in stops} <= {"acknowledged", "standing"}
    assert page.task(task["id"])["state"] == "killed"


def test_tasks_are_changed_and_cancelled(page: Web, check: Check) -> None:
    first = move(page, 1.0, delay=500)
    second = move(page, 1.0, after=first["id"])
    changed = page.send("PATCH", f"/tasks/{first['id']}", {"priority": 9, "label": "neu: ä"})
    assert changed.json()["priority"] == 9
    assert page.task(first["id"])["label"] == "neu: ä"
    third = move(page, 1.0, after=first["id"], every=60)
    changed = page.send("PATCH", f"/tasks/{third['id']}", {"after": 0, "cron": "0 7 * * *"})
    check("Task", changed.json())
    assert (changed.json()["after"], changed.json()["cron"]) == (None, "0 7 * * *")
    changed = page.send("PATCH", f"/tasks/{third['id']}", {"every": 0})
    assert (changed.json()["every"], changed.json()["cron"]) == (None, None)
    twice = page.send("PATCH", f"/tasks/{third['id']}", {"every": 60, "cron": "0 7 * * *"})
    assert "choose one" in twice.json()["detail"]
    page.post(f"/tasks/{first['id']}/cancel", {})
    assert page.wait_for(first["id"], "cancelled")["reason"] is not None
    assert page.wait_for(second["id"], "failed")["reason"] == "dependency_failed"
    over = page.send("POST", f"/tasks/{first['id']}/cancel", {})
    assert over.status_code == 409
    page.post("/vehicles/1/clear", {})


ITEM = "{}\t{}\t{}\t16\t0\t0\t0\t0\t{}\t{}\t0\t1\n"


def test_a_plan_is_shown_and_then_queued(page: Web, check: Check) -> None:
    rover = page.get("/vehicles/1")
    latitude, longitude = rover["latitude"], rover["longitude"]
    text = "QGC WPL 110\n" + ITEM.format(0, 1, 0, latitude, longitude)
    text += ITEM.format(1, 0, 3, latitude + 1e-5, longitude)
    shown = page.post("/plans", {"name": "yard.txt", "text": text})
    check("Plan", shown)
    assert shown["path"] == [{"latitude": pytest.approx(latitude + 1e-5), "longitude": longitude}]
    task = page.post("/vehicles/1/missions", {"text": text, "label": "yard"})
    assert task["goals"] == shown["path"]
    page.wait_for(task["id"], "completed")
    many = [ITEM.format(number, 0, 3, latitude, longitude) for number in range(1, 6_002)]
    for count, status in ((1_500, 201), (6_001, 422)):
        long = {"text": "QGC WPL 110\n" + "".join(many[:count])}
        assert page.send("POST", "/vehicles/1/missions", long).status_code == status, count


FENCES = """circle {"latitude": -35.3632, "longitude": 149.1652, "radius": 40}
polygon [{"latitude": -35.362, "longitude": 149.164}, {"latitude": -35.362, "longitude": 149.167}, \
{"latitude": -35.365, "longitude": 149.165}]"""


def test_the_fence_is_set_shown_and_removed(page: Web) -> None:
    for kind, shape in re.findall("(.*?) (.*)", FENCES):
        page.send("PUT", "/vehicles/1/fence", {kind: json.loads(shape)})
        (shown,) = page.get("/vehicles/1/fence")["shapes"]
        assert (shown["kind"], shown.get("radius")) in (("circle", 40), ("polygon", None))
        assert kind == shown["kind"]
    far = {"kind": "goto", "north": 400, "east": 0}
    refused = page.send("POST", "/vehicles/1/tasks", {"goals": [far]})
    assert refused.status_code == 409
    assert refused.json()["reason"] in ("outside_fence", None)
    assert page.send("DELETE", "/vehicles/1/fence", None).status_code == 204
    assert page.get("/vehicles/1/fence")["shapes"] == []
    both = page.send("PUT", "/vehicles/1/fence", {"circle": json.loads(shape), "polygon": []})
    assert both.status_code == 422


PLAN = r'{"text": "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t0\t0\t0\t1\n%s"}'
#: method, address, body, and the answer's status and words
ANSWERS = r"""POST /vehicles/1/tasks {"goals": []} 422 goals []: expected 1 to 200
POST /vehicles/1/tasks {"goals": [{"kind": "fly"}]} 422 goals[0].kind 'fly'
POST /vehicles/1/tasks {"goals": [{"kind": "move", "distance": true}]} 422 not a number: any
POST /vehicles/1/tasks {"goals": [{"kind": "wait", "duration": -1}]} 422 expected 0 s or more
POST /vehicles/1/tasks {"goals": [{"kind": "face", "heading": 1, "direction": 2}]} 422 not in -1..1
POST /vehicles/1/tasks {"goals": [7]} 422 goals[0]: expected an object
POST /vehicles/1/tasks {} 422 goals: missing
POST /vehicles/1/tasks {"goals": [{"kind": "home"}], "delay": true} 422 delay True
POST /vehicles/1/tasks {"goals": [{"kind": "home"}], "at": "noon"} 422 expected a time such as
POST /vehicles/1/tasks {"goals": [{"kind": "home"}], "at": "2099-01-01T10:00"} 422 a time zone
POST /vehicles/1/tasks {"goals": [{"kind": "home"}], "at": "2099-01-01T10:00Z"} 422 a year ahead
POST /vehicles/1/tasks {"goals": [{"kind": "home"}], "every": 60, "cron": "* * * * *"} 422 every and
POST /vehicles/9/pause {} 404 no rover 9; the server has: 1
POST /vehicles/1/resume {} 422 epoch: missing
POST /tasks/1/release {"how": "perhaps", "epoch": 1} 422 expected one of
PUT /vehicles/1/fence {} 422 expected one of text, circle, polygon
PUT /vehicles/1/fence {"text": "nonsense"} 422 text
POST /plans {"text": "no plan"} 422 text
GET /tasks/99999 null 404 no task 99999
GET /nothing null 404 there is nothing at this address
GET /records/x null 404 --records
DELETE /stop null 405 does not take that method
OPTIONS /stop null 405 not used here
GET /vehicles/1/queue?limit=x null 422 limit 'x': not a number
POST /stop [] 422 expected a JSON object
POST /stop {"vehicle": 0} 422 vehicle 0: not in 1..255"""
PLANS = r"""1\t0\t2\t54000\t1\t0\t0\t0\t0\t0\t0\t1\n 0
1\t0\t1\t16\t0\t0\t0\t0\t3\t4\t0\t1\n2\t0\t1\t16\t0\t0\t0\t0\t6\t8\t0\t1\n 5.0
1\t0\t1\t16\t0\t0\t0\t0\t3\t4\t0\t1\n2\t0\t3\t16\t0\t0\t0\t0\t6\t8\t0\t1\n null"""


def test_a_wrong_request_is_a_problem_that_names_what_was_wrong(page: Web, check: Check) -> None:
    for method, path, body, status, words in re.findall(r"(\S+) (\S+) (.*) (\d{3}) (.*)", ANSWERS):
        answer = page.send(method, path, json.loads(body))
        assert answer.status_code == int(status), answer.text
        assert answer.headers["content-type"] == "application/problem+json"
        check("Problem", answer.json())
        assert words in answer.json()["detail"]
    for items, length in re.findall("(.*) (.*)", PLANS):
        shown = page.post("/plans", json.loads(PLAN % items))
        assert json.dumps(shown["length"]) == length, items


def test_a_body_that_is_no_json_is_named(page: Web) -> None:
    for content in (b"{", b"\xff", b"[" * 60_000):
        headers = {"content-type": "application/json"}
        answer = page.client.post("/api/v1/stop", content=content, headers=headers)
        assert answer.status_code == 400, answer.text


def test_a_stream_goes_on_where_it_ended(page: Web, check: Check) -> None:
    stream = page.events()
    kind, last, snapshot = next(stream)
    assert kind == "snapshot"
    check("Vehicle", snapshot["vehicles"][0])
    check("Queue", snapshot["queues"][0])
    stream.close()  # type: ignore[attr-defined]
    task = move(page, 1.0, delay=900)
    ids = []
    for kind, number, data in page.events(last=last):
        assert kind != "snapshot"
        if number:
            ids.append(int(number.rpartition("-")[2]))
        if kind == "task" and data["id"] == task["id"]:
            break
    assert ids == sorted(ids)


def test_events_are_as_the_document_says(page: Web, check: Check) -> None:
    schemas = {
        "vehicles": "VehicleStates",
        "queue": "QueueChange",
        "task": "Task",
        "text": "Text",
        "stop": "Stop",
    }
    wanted = {"snapshot", *schemas}
    stream = page.events()
    check("Snapshot", next(stream)[2])
    move(page, 0.3)
    page.post("/stop", {})
    seen = {"snapshot"}
    while seen != wanted:
        kind, _, data = next(stream)
        check(schemas[kind], data)
        seen.add(kind)


def test_a_session_is_a_cookie_that_scripts_cannot_read(
    tmp_path: Path, both: tuple[Stand, Web]
) -> None:
    (tmp_path / "x.tlog").write_bytes(b"nonsense")
    token = add_key(tmp_path, "anna", "submitter")
    shown = ("--tiles", "https://{s}.tiles.example/{z}/{x}/{y}", "--records", str(tmp_path))
    with web(tmp_path, both[0], *shown, name="session") as it:
        for headers in ({}, {"authorization": "Bearer x"}, {"cookie": "a/b=1"}):
            assert it.send("GET", "/session", None, **headers).status_code == 401
        policy = it.client.get("/").headers["content-security-policy"]
        assert "img-src 'self' https://*.tiles.example " in policy
        login = it.send("POST", "/session", {"token": token})
        assert it.send("POST", "/session", {"token": token}).status_code == 204
        cookie = login.headers["set-cookie"]
        assert "HttpOnly" in cookie
        assert "SameSite=strict" in cookie
        assert it.get("/session")["name"] == "anna"
        assert it.get("/records")["records"][0]["name"] == "x"
        for name, status in (("x", 422), ("y", 404)):
            assert it.send("GET", f"/records/{name}", None).status_code == status
        assert it.send("GET", "/journal", None).status_code == 404
        assert it.send("DELETE", "/session", None).status_code == 204
        assert it.send("GET", "/session", None).status_code == 401


#: as in the guide
WITH_CURL = """curl http://127.0.0.1:8560/api/v1/vehicles/1/tasks -H 'Content-Type: application/json' -d '{"goals": [{"kind": "move", "distance": 2}]}'"""  # noqa: E501


def test_the_command_of_the_guide(page: Web) -> None:
    curl, url, *options = shlex.split(WITH_CURL)
    command = [curl, "-sS", url.replace("http://127.0.0.1:8560", page.url), *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=True)
    assert json.loads(done.stdout)["what"] == "move 2 m"


@awaited
async def test_a_client_made_of_the_document_drives_a_task(both: tuple[Stand, Web]) -> None:
    """Its models are those of the document: they refuse an answer that is not as it says."""
    url = f"{both[1].url}/api/v1/openapi.json"
    api: Any = OpenAPI(url, both[1].get("/openapi.json"))
    made = api._
    rover = {"vehicle": 1}
    queue = await made.get_vehicles_by_vehicle_queue(parameters=rover)
    await made.post_vehicles_by_vehicle_resume(parameters=rover, data={"epoch": queue.halt_epoch})
    goals = [{"kind": "move", "distance": 0.3}]
    named = rover | {"idempotency-key": "made of the document"}
    task = await made.post_vehicles_by_vehicle_tasks(parameters=named, data={"goals": goals})
    again = await made.post_vehicles_by_vehicle_tasks(parameters=named, data={"goals": goals})
    assert (task.what, task.id) == ("move 0.3 m", again.id)
    while task.state != "completed":
        task = await made.get_tasks_by_task(parameters={"task": task.id})
        assert task.state in ("queued", "starting", "executing", "completed")
    timing = await made.get_tasks_by_task_timing(parameters={"task": task.id})
    assert timing.count > 5
    assert (await made.get_vehicles()).vehicles[0].vehicle == 1
    stop = await made.post_stop(data={"vehicle": 1})
    assert stop.phase == "acknowledged"
    both[1].resume()
