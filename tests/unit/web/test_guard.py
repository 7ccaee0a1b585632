"""Which requests reach the API: attacks by web pages, tokens, limits. No sockets."""

from collections.abc import AsyncIterator
from pathlib import Path

import httpx
import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from mav_tasks.client.aio import Client
from mav_tasks.key_ring.ring import Entry, KeyRing, key_of
from mav_tasks.key_ring.ring_file import Loaded
from mav_tasks.key_ring.watch import RingWatch
from mav_tasks.web import rates
from mav_tasks.web.guard import PLAN_BODY, SMALL_BODY, Guard
from mav_tasks.web.problems import Problem
from mav_tasks.web.sessions import COOKIE, Sessions
from mav_tasks.web.users import Users
from tests.kit.awaited import awaited

HOST = "127.0.0.1:8560"
JSON = {"content-type": "application/json"}
SECRET = b"a" * 32
TOKEN = SECRET.hex()


class Rig:
    """A guard around an application that says who asked and how long the body was."""

    def __init__(self, folder: Path, *, has_key: bool = False) -> None:
        self.key = key_of("anna", "submitter", SECRET)
        ring = KeyRing((Entry("anna", "submitter", self.key),) if has_key else ())
        watch = RingWatch(folder / "keys.toml", Loaded(ring, (0, 0, 0, 0, 0)))
        client = Client()
        users = Users(watch, client, server="", own_key=None, connect=lambda _key: client)
        self.sessions = Sessions(users)
        app = Starlette(
            routes=[
                Route("/api/v1/{rest:path}", _said, methods=["GET", "POST", "PUT", "PATCH"]),
                Route("/", _said),
            ],
            exception_handlers={Problem: _problem},
        )
        guard = Guard(
            app,
            hosts={HOST},
            users=users,
            sessions=self.sessions,
            is_open=True,
        )
        transport = httpx.ASGITransport(app=guard, client=("127.0.0.1", 5))
        self.client = httpx.AsyncClient(transport=transport, base_url=f"http://{HOST}")


async def _said(request: Request) -> Response:
    identity = request.state.identity
    body = await request.body()
    name = None if identity is None else f"{identity.name} {identity.role}"
    return JSONResponse({"who": name, "bytes": len(body)})


async def _problem(_request: Request, error: Exception) -> Response:
    assert isinstance(error, Problem)
    return error.response()


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8560", "127.0.0.1", "127.0.0.1:80", "", f"{HOST}."]
)
@awaited
async def test_another_host_is_refused_dns_rebinding(tmp_path: Path, host: str) -> None:
    answer = await Rig(tmp_path).client.get("/api/v1/vehicles", headers={"host": host})
    assert answer.status_code == 421
    assert answer.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize(
    "headers",
    [
        {"origin": "https://evil.example"},
        {"origin": "null"},
        {"origin": "http://127.0.0.1:9999"},
        {"origin": f"https://{HOST}"},
        {"sec-fetch-site": "cross-site"},
        {"sec-fetch-site": "same-site"},
        {"sec-fetch-site": "cross-site", "origin": f"http://{HOST}"},
    ],
)
@awaited
async def test_a_page_of_another_site_changes_nothing(
    tmp_path: Path, headers: dict[str, str]
) -> None:
    answer = await Rig(tmp_path).client.post("/api/v1/stop", headers=JSON | headers, content="{}")
    assert answer.status_code == 403


@pytest.mark.parametrize(
    "kind", ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data; x=y", ""]
)
@awaited
async def test_a_body_that_a_form_could_send_is_refused(tmp_path: Path, kind: str) -> None:
    headers = {"content-type": kind} if kind else {}
    answer = await Rig(tmp_path).client.post("/api/v1/stop", headers=headers, content="{}")
    assert answer.status_code == 415


@awaited
async def test_our_own_page_and_programs_pass(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    ours = {"origin": f"http://{HOST}", "sec-fetch-site": "same-origin"}
    for headers in (JSON, JSON | ours, {"content-type": "application/json; charset=utf-8"}):
        answer = await rig.client.post("/api/v1/stop", headers=headers, content="{}")
        assert answer.json() == {"who": "a local user None", "bytes": 2}


@awaited
async def test_every_answer_forbids_what_the_page_does_not_need(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    answers = [
        await rig.client.get("/"),
        await rig.client.get("/nothing"),
        await rig.client.get("/", headers={"host": "evil.example"}),
    ]
    for answer in answers:
        policy = answer.headers["content-security-policy"]
        assert "default-src 'self'" in policy
        assert "frame-ancestors 'none'" in policy
        assert "unsafe" not in policy
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert "access-control-allow-origin" not in answer.headers


@awaited
async def test_without_a_token_nothing_but_the_page_and_the_login(tmp_path: Path) -> None:
    rig = Rig(tmp_path, has_key=True)
    assert (await rig.client.get("/api/v1/vehicles")).status_code == 401
    stop = await rig.client.post("/api/v1/stop", headers=JSON, content="{}")
    assert stop.status_code == 401
    assert stop.headers["www-authenticate"] == "Bearer"
    assert (await rig.client.get("/")).status_code == 200
    assert (await rig.client.get("/metrics")).status_code == 401
    login = await rig.client.post("/api/v1/session", headers=JSON, content="{}")
    assert login.json()["who"] is None


@awaited
async def test_a_token_names_its_holder(tmp_path: Path) -> None:
    rig = Rig(tmp_path, has_key=True)
    for text in (TOKEN, TOKEN.upper()):
        bearer = {"authorization": f"Bearer {text}"}
        answer = await rig.client.get("/api/v1/vehicles", headers=bearer)
        assert answer.json()["who"] == "anna submitter"
    for wrong in (f"Bearer {TOKEN}x", "Bearer x", f"Bearer {TOKEN[:-1]}"):
        refused = await rig.client.get("/api/v1/vehicles", headers={"authorization": wrong})
        assert refused.status_code == 401


@awaited
async def test_a_session_ends_when_it_is_ended(tmp_path: Path) -> None:
    rig = Rig(tmp_path, has_key=True)
    numbers = [rig.sessions.begin(rig.key) for _ in range(2)]

    async def who(number: str) -> int:
        headers = {"cookie": f"{COOKIE}={number}"}
        return (await rig.client.get("/api/v1/vehicles", headers=headers)).status_code

    assert [await who(number) for number in numbers] == [200, 200]
    rig.sessions.end(numbers[0])
    assert [await who(number) for number in numbers] == [401, 200]
    assert await who(numbers[1][:-1]) == 401


@awaited
async def test_a_stolen_cookie_does_not_help_a_page_of_another_site(tmp_path: Path) -> None:
    rig = Rig(tmp_path, has_key=True)
    cookie = {"cookie": f"{COOKIE}={rig.sessions.begin(rig.key)}"}
    evil = JSON | cookie | {"origin": "https://evil.example"}
    answer = await rig.client.post("/api/v1/stop", headers=evil, content="{}")
    assert answer.status_code == 403


@awaited
async def test_a_large_body_is_refused_before_and_while_it_is_read(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    announced = await rig.client.post("/api/v1/stop", headers=JSON, content=b"x" * (SMALL_BODY + 1))
    assert announced.status_code == 413

    async def pieces() -> AsyncIterator[bytes]:
        for _ in range(SMALL_BODY // 1024 + 1):
            yield b"x" * 1024

    chunked = await rig.client.post("/api/v1/stop", headers=JSON, content=pieces())
    assert chunked.status_code == 413
    plan = await rig.client.post("/api/v1/plans", headers=JSON, content=b"x" * (SMALL_BODY + 1))
    assert plan.json()["bytes"] == SMALL_BODY + 1
    headers = JSON | {"content-length": str(PLAN_BODY + 1)}
    assert (await rig.client.post("/api/v1/plans", headers=headers)).status_code == 413
    headers = JSON | {"content-length": "-1"}
    assert (await rig.client.post("/api/v1/plans", headers=headers)).status_code == 413


@awaited
async def test_too_many_requests_are_refused_but_a_stop_never_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig, now = Rig(tmp_path), 1000.0
    monkeypatch.setattr("mav_tasks.web.rates.time.monotonic", lambda: now)

    async def looked() -> httpx.Response:
        return await rig.client.get("/api/v1/vehicles")

    codes = [(await looked()).status_code for _ in range(int(rates.AT_ONCE) + 5)]
    assert codes == [200] * int(rates.AT_ONCE) + [429] * 5
    assert (await looked()).headers["retry-after"] == "1"
    now += 1.001 / rates.PER_SECOND
    assert [(await looked()).status_code for _ in range(2)] == [200, 429]
    for _ in range(20):
        stop = await rig.client.post("/api/v1/stop", headers=JSON, content="{}")
        assert stop.status_code == 200


@awaited
async def test_nothing_uses_up_the_requests_that_a_pause_needs(tmp_path: Path) -> None:
    rig = Rig(tmp_path)

    async def looked(**headers: str) -> int:
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        return (await rig.client.get("/api/v1/vehicles", headers=named)).status_code

    many = int(rates.AT_ONCE) - 50  # later ones are answered slowly
    codes = {await looked(sec_fetch_site="cross-site") for _ in range(many)}
    assert codes == {403}  # a page of another site, with a picture from this address
    assert await looked(sec_fetch_site="same-origin") == 200
    while await looked() == 200:  # a program that asks without end
        pass
    for _ in range(5):
        paused = await rig.client.post("/api/v1/vehicles/1/pause", headers=JSON, content="{}")
        assert paused.status_code == 200


@awaited
async def test_headers_that_come_twice_and_strange_methods_are_refused(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    for name, one, two in (
        ("host", HOST, "evil.example"),
        ("sec-fetch-site", "cross-site", "same-origin"),
        ("content-type", "text/plain", "application/json"),
    ):
        twice = [(name, one), (name, two)]
        assert (await rig.client.get("/", headers=twice)).status_code == 400
    assert (await rig.client.request("TRACE", "/")).status_code == 405
    assert (await rig.client.request("CONNECT", "/")).status_code == 405
