"""Who uses the page is a client of the server, with a key; test_rights.py compares the answers."""

import json
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest

from mav_tasks import Key, SyncClient, Wait
from tests.kit.commands import called
from tests.kit.processes import Stand, process, stand, wait_until
from tests.kit.web import Web, add_key, has_rover, ring_of, web

pytestmark = pytest.mark.slow

ROLES = {"ola": "observer", "sam": "submitter", "otto": "operator", "sue": "safety"}
LIMITS = {"max_priority": 7, "max_speed": 1.0, "quota": 3}
LATER = 1000  # s: no task of these tests begins


@dataclass
class Rig:
    """A server with a key for each role, a rover, and a web process; tokens and clients by name."""

    folder: Path
    stand: Stand
    page: Web
    tokens: dict[str, str]
    clients: dict[str, SyncClient]

    def http(self, name: str, method: str, path: str, body: Any = None) -> httpx.Response:
        """Send a request with a user's token."""
        return self.page.send(method, path, body, authorization=f"Bearer {self.tokens[name]}")

    def submit(self, name: str, **more: Any) -> httpx.Response:
        """Submit a task that waits."""
        body = {"goals": [{"kind": "wait", "duration": 5}], "delay": LATER} | more
        return self.http(name, "POST", "/vehicles/1/tasks", body)

    def key(self, name: str) -> Key:
        """Return a user's key."""
        return Key(name, bytes.fromhex(self.tokens[name]))


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """One of each for all of them."""
    folder = tmp_path_factory.mktemp("rights")
    tokens = {name: add_key(folder, name, role) for name, role in ROLES.items()}
    limits = [f"roles.submitter.{name}={value}" for name, value in LIMITS.items()]
    options = [word for each in limits for word in ("--set", each)]
    store = str(folder / "tasks.sqlite3")
    with (
        stand(folder, *options, serve_store=store) as it,
        web(folder, it, "--store", store) as page,
        ExitStack() as opened,
    ):
        page.client.headers["authorization"] = f"Bearer {tokens['sue']}"
        has_rover(page)
        url = f"udpout:127.0.0.1:{it.client_port}"
        clients = {
            name: opened.enter_context(SyncClient(url, key=Key(name, bytes.fromhex(token))))
            for name, token in tokens.items()
        }
        yield Rig(folder, it, page, tokens, clients)


def test_the_server_knows_who_submitted_and_who_stopped(rig: Rig) -> None:
    task = rig.submit("sam").json()["id"]
    assert rig.http("sam", "PATCH", f"/tasks/{task}", {"priority": 2}).json()["priority"] == 2
    assert rig.http("sam", "POST", f"/tasks/{task}/cancel", {}).status_code == 204
    entries = rig.http("ola", "GET", f"/tasks/{task}/journal").json()["entries"]
    assert sum("signed sam" in json.dumps(entry) for entry in entries) >= 2
    messages = [entry["message"] for entry in entries]
    assert any(" by sam at " in words for words in messages)
    assert "244/190" not in " ".join(messages)
    script = rig.clients["otto"].submit(Wait(5), delay=LATER)
    assert rig.http("ola", "GET", f"/tasks/{script.id}").json()["submitted_by"] == "otto"
    script.cancel()
    rig.clients["otto"].resume()  # of the STOP of another test
    assert rig.submit("ola").status_code == 403  # over her own connection, which is open now
    stop = rig.http("ola", "POST", "/stop", {})
    assert (stop.status_code, stop.json()["by"]) == (200, "ola")
    wait_until(
        lambda: "signed ola" in rig.stand.server.text,
        within=5,
        what=lambda: rig.stand.server.text[-1000:],
    )


def test_a_token_of_another_ring_does_nothing_but_stop(rig: Rig, tmp_path: Path) -> None:
    """The server would take unsigned packets: what it does not know is not sent to it unsigned."""
    token = add_key(tmp_path, "eve", "safety")
    with web(tmp_path, rig.stand, name="other") as page:
        page.client.headers["authorization"] = f"Bearer {token}"
        has_rover(page)
        refused = page.send("POST", "/vehicles/1/tasks", {"goals": [{"kind": "home"}]})
        assert refused.status_code == 504
        assert "does the server have key eve (" in refused.json()["detail"]
        assert page.post("/stop", {})["phase"] == "acknowledged"


def test_a_revoked_key_ends_its_session_and_does_nothing_more(rig: Rig) -> None:
    token = add_key(rig.folder, "ben", "operator")
    with httpx.Client(base_url=rig.page.url, timeout=10) as client:

        def has_logged_in() -> bool:
            return client.post("/api/v1/session", json={"token": token.upper()}).is_success

        wait_until(has_logged_in, within=5, what="the new key")
        cookie = client.get("/api/v1/session")
        assert (cookie.json()["name"], cookie.json()["role"]) == ("ben", "operator")
        assert client.post("/api/v1/vehicles/1/pause", json={}).status_code == 204
        done = called("keys", "revoke", "ben", "--keys", str(ring_of(rig.folder)))
        assert done.status == 0, done.error

        def is_out() -> bool:
            return client.get("/api/v1/session").status_code == 401

        wait_until(is_out, within=5, what="the end of its session")
        bearer = {"authorization": f"Bearer {token}"}
        assert client.get("/api/v1/vehicles", headers=bearer).status_code == 401


def test_a_person_sees_what_the_role_may_do(rig: Rig) -> None:
    may = {name: set(rig.http(name, "GET", "/session").json()["may"]) for name in ROLES}
    assert not may["ola"]
    assert may["sam"] - may["ola"] == {"submit", "cancel", "modify", "release"}
    assert may["otto"] - may["sam"] == {"resume", "clear"}
    assert may["sue"] - may["otto"] == {"fence"}


@pytest.fixture(scope="module")
def open_page(rig: Rig, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Web]:
    """A web process on loopback without a key."""
    with web(tmp_path_factory.mktemp("open"), rig.stand, name="open") as page:
        yield page


@pytest.mark.parametrize(
    "name",
    ["x-forwarded-for", "x-forwarded-host", "x-real-ip", "forwarded", "via"],
)
def test_a_proxy_on_this_machine_lets_nobody_in(name: str, open_page: Web) -> None:
    assert open_page.get("/session")["name"] == "a local user"
    headers = {name: "203.0.113.9"}
    refused = open_page.client.post("/api/v1/stop", json={}, headers=headers)
    assert refused.status_code == 401
    assert "mav-tasks keys add NAME --role operator" in refused.json()["detail"]
    assert open_page.client.get("/", headers=headers).status_code == 200  # where to log in


def test_the_first_key_closes_an_open_page(rig: Rig, tmp_path: Path) -> None:
    with web(tmp_path, rig.stand, name="closing") as page:
        with page.client.stream("GET", "/api/v1/events") as stream:
            token = add_key(tmp_path, "anna", "observer")
            wait_until(
                lambda: page.client.get("/api/v1/session").status_code == 401,
                within=5,
                what="a page that needs a token",
            )
            assert list(stream.iter_lines())  # it ends
        bearer = {"authorization": f"Bearer {token}"}
        assert page.client.get("/api/v1/session", headers=bearer).json()["name"] == "anna"
        done = called("keys", "revoke", "anna", "--keys", str(ring_of(tmp_path)))
        assert done.status == 0, done.error
        wait_until(lambda: "anna was revoked" in page.process.text, within=5, what="the log")
        for named in (bearer, {}):  # nor does the end of the last one open it again
            assert page.client.get("/api/v1/session", headers=named).status_code == 401


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--listen", "0.0.0.0:0"), "--listen 0.0.0.0:0: who sits elsewhere needs a token"),
        (("--role", "observer"), "--role: the server decides"),
        (("tokens", "add", "anna", "--role", "operator"), "keys of the key ring now"),
        (("--keys", "none.toml"), "key ring none.toml does not exist"),
    ],
)
def test_a_page_that_needs_a_key_says_how_to_make_one(
    options: tuple[str, ...], words: str, tmp_path: Path
) -> None:
    command = ("-m", "mav_tasks.cli", "web", *options)
    with process(*command, folder=tmp_path, name="refused") as it:
        assert it.popen.wait(20) == 2
    assert words in it.text
    assert len(it.text.splitlines()) == 1
