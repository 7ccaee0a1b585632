"""Attacks on a real web process, beside a real server and rover. Each was one that worked."""

import json
import re
import socket
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from tests.kit.processes import Stand, process, wait_until
from tests.kit.web import Web, add_key, served, web

pytestmark = pytest.mark.slow

JSON = {"content-type": "application/json"}
HUGE = "1" + "0" * 400  # a whole number that no float holds


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Stand, Web]]:
    """One server, rover and web process for all of them."""
    with served(tmp_path_factory.mktemp("hostile")) as it:
        yield it


@pytest.fixture
def page(both: tuple[Stand, Web]) -> Web:
    """The web process."""
    return both[1]


#: a request with a body, and the part that its answer names; MOVE: its distance follows
BODIES = r"""POST /vehicles/1/tasks {"goals": [{"kind": "home"}], "delay": HUGE} => delay
POST /vehicles/1/tasks MOVE HUGE}]} => goals[0].distance
POST /vehicles/1/tasks MOVE -HUGE}]} => goals[0].distance
POST /vehicles/1/tasks MOVE 1e308}]} => goals[0].distance
POST /vehicles/1/tasks MOVE NaN}]} => goals[0].distance
POST /vehicles/1/tasks MOVE 1e400}]} => goals[0].distance
POST /vehicles/1/tasks {"goals": [{"kind": "goto", "north": 1e308, "east": 0}]} => north
POST /vehicles/1/tasks {"goals": [{"kind": "goto", "north": 1e38, "east": 0}]} => north
POST /vehicles/1/tasks {"goals": [{"kind": "home", "\ud800": 1}]} => \ud800
POST /vehicles/1/tasks {"goals": [{"kind": "home"}], "label": "\ud800"} => label
POST /vehicles/1/tasks {"goals": [{"kind": "home"}], "preemptive": true} => preemptive: unknown
POST /vehicles/1/tasks {"goals": [{"kind": "home"}], "at": "2100-01-01T00:00Z"} => a year ahead
PUT /vehicles/1/fence {"circle": {"latitude": HUGE, "longitude": 1, "radius": 1}} => circle.latitude
POST /vehicles/1/resume {"epoch": 1, "epoch": 2} => epoch: it comes twice
POST /vehicles/1/tasks MOVE 1, "kind": "home"}]} => kind: it comes twice
POST /stop {"identity": {"role": "safety"}} => identity"""
MOVE = '{"goals": [{"kind": "move", "distance":'


def test_no_value_of_a_part_breaks_it(page: Web) -> None:
    rows = BODIES.replace("MOVE", MOVE).replace("HUGE", HUGE)
    for method, path, body, name in re.findall(r"(\S+) (\S+) (.*) => (.*)", rows):
        answer = page.client.request(method, f"/api/v1{path}", content=body, headers=JSON)
        assert answer.status_code == 422, answer.text
        assert answer.headers["content-type"] == "application/problem+json"
        assert name in answer.json()["detail"]


NINES = "9" * 5000  # more digits than Python converts


NOT_FOUND = """/api/v1/tasks/0
/api/v1/tasks/1073741824
/api/v1/tasks/9999999999
/api/v1/tasks/NINES
/api/v1/vehicles/0/queue
/api/v1/vehicles/256/queue
/api/v1/vehicles/9999999999/queue
/api/v1/vehicles/NINES/queue
/tasks/NINES
/tiles/1/1/1
/tiles/1/NINES/1
/tiles/1/1/NINES
/tiles/NINES/1/1"""


def test_an_id_out_of_range_is_not_found_and_never_asked_for(page: Web) -> None:
    for path in NOT_FOUND.replace("NINES", NINES).splitlines():
        answer = page.client.get(path, timeout=5)  # a request that nobody answers takes 10 s
        assert answer.status_code == 404, path[:80]


@pytest.mark.parametrize("epoch", [0, 1 << 24, 1 << 25, -1, 1 << 32, 1.5, True])
def test_an_epoch_that_names_no_halt_does_not_release_a_stop(page: Web, epoch: object) -> None:
    page.post("/stop", {})
    refused = page.send("POST", "/vehicles/1/resume", {"epoch": epoch})
    assert refused.status_code == 422
    assert refused.json()["detail"].startswith("epoch")
    assert page.get("/vehicles/1/queue")["paused"] == "stopped"


TRIES = """POST /vehicles/1/resume {"epoch": SEEN}
POST /tasks/TASK/release {"how": "again", "epoch": SEEN}
POST /tasks/LATER/release {"how": "remainder", "epoch": SEEN}
POST /vehicles/1/tasks {"goals": [{"kind": "move", "distance": 5}], "priority": 10}
POST /vehicles/1/tasks {"goals": [{"kind": "rotate", "angle": 90}]}
POST /vehicles/1/tasks {"goals": [{"kind": "home"}], "priority": 10}
POST /vehicles/1/missions {"text": PLAN, "priority": 10}
PATCH /tasks/LATER {"delay": 0, "priority": 10, "preemptive": true}
POST /vehicles/1/pause {}
PUT /vehicles/1/fence {"circle": CIRCLE}
DELETE /vehicles/1/fence null
POST /tasks/TASK/cancel {}
POST /tasks/LATER/cancel {"kill": true}
POST /vehicles/1/clear {"running_too": true}
POST /vehicles/1/tasks {"goals": [{"kind": "move", "distance": 5}], "priority": 10}"""


def test_nothing_but_a_resume_that_has_seen_it_ends_a_stop(both: tuple[Stand, Web]) -> None:
    """Each operation that may set a rover in motion, by a page that shows an older STOP."""
    it, page = both
    page.post("/stop", {"clear": True})
    seen = page.get("/vehicles/1/queue")["halt_epoch"]
    page.resume()
    move = {"goals": [{"kind": "move", "distance": 5}]}
    task = page.post("/vehicles/1/tasks", move)["id"]
    later = page.post("/vehicles/1/tasks", move | {"delay": 1000})["id"]
    page.wait_for(task, "executing")
    newer = page.post("/stop", {})
    assert newer["phase"] == "acknowledged"
    wait_until(lambda: it.speed() < 0.01, within=15, what="a rover that stands")
    where = it.truth()[-1]
    rover = page.get("/vehicles/1")
    item = "1\t0\t3\t16\t0\t0\t0\t0\t{}\t{}\t0\t1\n".format(*_near(rover))
    plan = "QGC WPL 110\n0" + item[1:] + item
    known = {"SEEN": seen, "TASK": task, "LATER": later, "PLAN": plan, "CIRCLE": _circle(rover)}
    rows = re.sub(
        "[A-Z]+", lambda word: json.dumps(known[word[0]]) if word[0] in known else word[0], TRIES
    )
    tries = (row.split(" ", 2) for row in rows.splitlines())
    codes = {
        path: page.send(method, path, json.loads(body)).status_code for method, path, body in tries
    }
    assert codes["/vehicles/1/resume"] == 409
    assert codes["/vehicles/1/missions"] == 201
    queue = page.get("/vehicles/1/queue")
    assert (queue["paused"], queue["running"]) == ("stopped", None)
    assert queue["halt_epoch"] > seen
    now = it.truth()[-1]
    assert abs(now["north"] - where["north"]) + abs(now["east"] - where["east"]) < 0.05
    page.post("/stop", {"clear": True})


def _near(rover: dict[str, float]) -> tuple[float, float]:
    return rover["latitude"] + 3e-5, rover["longitude"]


def _circle(rover: dict[str, float]) -> dict[str, float]:
    return {"latitude": rover["latitude"], "longitude": rover["longitude"], "radius": 50.0}


def _raw(page: Web, request: str) -> bytes:
    """Return all that is answered to some bytes."""
    port = int(page.url.rpartition(":")[2])
    with socket.create_connection(("127.0.0.1", port), 15) as connection:
        connection.sendall(request.format(host=f"Host: 127.0.0.1:{port}\r\n").encode())
        answer = b""
        while data := connection.recv(65536):
            answer += data
        return answer


def test_a_request_is_not_hidden_in_another_ones_body(page: Web) -> None:
    answer = _raw(
        page,
        "POST /api/v1/vehicles/1/pause HTTP/1.1\r\n{host}Content-Type: application/json\r\n"
        "Content-Length: 6\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n"
        "GET /api/v1/session HTTP/1.1\r\n{host}Connection: close\r\n\r\n",
    )
    assert answer.count(b"HTTP/1.1 ") == 1
    assert answer.startswith(b"HTTP/1.1 400")


def test_behind_a_proxy_with_tls_only_its_own_pages_may_change_something(
    tmp_path: Path, both: tuple[Stand, Web]
) -> None:
    names = ("--name", "rover.example", "--name", "rover.example:8443")
    token = add_key(tmp_path, "anna", "observer")
    with web(tmp_path, both[0], *names, name="proxied") as page:
        for host in ("rover.example", page.url.removeprefix("http://")):
            # whoever asks by whatever name: a proxy may have put its own there
            assert page.send("POST", "/stop", {}, host=host).status_code == 401
        page.client.headers["authorization"] = f"Bearer {token}"
        port = page.url.rpartition(":")[2]

        def stop(host: str, origin: str) -> int:
            return page.send("POST", "/stop", {}, host=host, origin=origin).status_code

        for host in ("rover.example", "rover.example:8443", f"rover.example:{port}"):
            assert page.client.get("/", headers={"host": host}).status_code == 200
            assert stop(host, f"http://{host}") == 200
            assert stop(host, "https://evil.example") == 403
        assert stop("rover.example", "https://rover.example") == 200
        assert stop("rover.example:8443", "https://rover.example:8443") == 200
        assert stop("rover.example", "https://rover.example:8443") == 403
        assert stop(f"rover.example:{port}", f"https://rover.example:{port}") == 403
        assert stop("evil.example", "https://evil.example") == 421
        assert stop("127.0.0.1", "http://127.0.0.1") == 421
        for origin, is_secure in (("https", True), ("http", False)):
            login = page.send(
                *("POST", "/session", {"token": token}),
                host="rover.example",
                origin=f"{origin}://rover.example",
            )
            assert ("; Secure" in login.headers["set-cookie"]) == is_secure


def test_who_has_no_token_learns_nothing_of_the_server(tmp_path: Path) -> None:
    add_key(tmp_path, "anna", "observer")
    command = ["-m", "mav_tasks.cli", "web", "--listen", "127.0.0.1:0", "--store", ""]
    command += ["--server", "udpout:127.0.0.1:9"]
    with process(*command, folder=tmp_path, name="alone") as alone:
        url = alone.wait_for(r"web page: (http://\S+)/\n")[1]
        ready = httpx.get(f"{url}/readyz")
        assert (ready.status_code, ready.text) == (503, "no answer from the task server\n")
        for path in ("/metrics", "/api/v1/openapi.json", "/api/v1/session"):
            assert httpx.get(f"{url}{path}").status_code == 401


def test_what_a_page_of_another_site_can_send_changes_nothing(page: Web) -> None:
    """By DNS rebinding, by forms, by scripts: hosts, origins, types of bodies, doubled headers."""
    host = page.url.removeprefix("http://")
    ours = {"origin": f"http://{host}", "sec-fetch-site": "same-origin"}
    refused = {
        421: [{"host": name} for name in ("evil.example", "127.0.0.1.evil.example", "[::1]:1")],
        403: [
            *({"origin": each} for each in ("https://evil.example", "null", f"https://{host}")),
            {"sec-fetch-site": "cross-site"},
            {"sec-fetch-site": "same-site", "origin": f"http://{host}"},
        ],
        415: [
            {"content-type": each}
            for each in ("text/plain", "application/x-www-form-urlencoded", "multipart/form-data")
        ],
        200: [ours, {}, {"content-type": "application/json; charset=utf-8"}],
    }
    wrong: list[tuple[object, int]] = []
    for status, cases in refused.items():
        for headers in cases:
            answer = page.client.post("/api/v1/stop", content="{}", headers=JSON | headers)
            if answer.status_code != status:
                wrong.append((headers, answer.status_code))
    assert wrong == []
    for twice in (
        "{host}Host: evil.example\r\n",
        "{host}Sec-Fetch-Site: cross-site\r\nSec-Fetch-Site: same-origin\r\n",
        "{host}Content-Type: text/plain\r\nContent-Type: application/json\r\n",
    ):
        answered = _raw(page, f"GET / HTTP/1.1\r\n{twice}Connection: close\r\n\r\n")
        assert answered.startswith(b"HTTP/1.1 400"), twice
    for answer in (page.client.get("/"), page.client.get("/nothing")):
        policy = answer.headers["content-security-policy"]
        assert "default-src 'self'" in policy
        assert "frame-ancestors 'none'" in policy
        assert "unsafe" not in policy
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert "access-control-allow-origin" not in answer.headers


def test_large_bodies_are_refused_before_and_while_they_are_read(page: Web) -> None:
    for body in (b"x" * 70_000, iter([b"x" * 1024] * 70)):
        assert page.client.post("/api/v1/stop", headers=JSON, content=body).status_code == 413
