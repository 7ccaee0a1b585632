"""Decides which requests reach the API: the outermost layer of the web process. ASGI.

A page of another site can make a browser send requests to 127.0.0.1. The guard refuses them by Host
(DNS rebinding), and by Origin and Sec-Fetch-Site (cross-site requests). A body must be JSON, which
a browser sends to another site only after a preflight. The headers of every answer keep a browser
from running or framing anything else.
"""

import asyncio
from collections.abc import Callable, Iterable
from http.cookies import CookieError, SimpleCookie
from typing import Any

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from mav_tasks.web.identity import LOCAL, Identity
from mav_tasks.web.problems import Problem
from mav_tasks.web.rates import Rates
from mav_tasks.web.sessions import COOKIE, Sessions
from mav_tasks.web.users import Users

SAFE = frozenset({"GET", "HEAD"})
METHODS = SAFE | {"POST", "PUT", "PATCH", "DELETE"}
API = "/api/"
SESSION = "/api/v1/session"
STOP = "/api/v1/stop"
PAUSE = "/pause"
METRICS = "/metrics"

SMALL_BODY = 64 * 1024  # bytes
PLAN_BODY = 12 * 1024 * 1024  # bytes: a plan file of 6 MB, escaped
LARGE_ONES = 4  # larger bodies than SMALL_BODY that are held at a time
WITH_PLANS = ("/plans", "/missions", "/fence", "/rally")
SLOWED = 0.5  # s until a refusal is sent to who gets too many of them
BODY_WITHIN = 15.0  # s for the whole body

NO_TOKEN = (
    "a token is required: log in, or send 'Authorization: Bearer TOKEN'; "
    "'mav-tasks keys add NAME --role operator' makes one"
)
UNKNOWN = "there is no such token, or it was revoked"
#: headers of proxies, besides X-Forwarded-...
PROXIES = frozenset({"forwarded", "via", "x-real-ip"})
#: headers that decide; programs differ in which of two counts
ONCE = frozenset(
    {"host", "origin", "sec-fetch-site", "authorization", "content-type", "content-length"}
)
HEADERS = {
    "content-security-policy": (
        "default-src 'self'; img-src 'self' data: blob:; connect-src 'self'; object-src 'none'; "
        "base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
    ),
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), microphone=(), geolocation=(), payment=(), usb=()",
}
RAW_HEADERS = [(name.encode(), value.encode()) for name, value in HEADERS.items()]


class Guard:
    """The layer around an application.

    ``hosts`` are the values of Host that are accepted, in lower case; ``behind_tls`` are those of
    them that a proxy serves with TLS, so that its pages have an https origin. ``is_open``: whether
    only this machine can ask, so that a token is needed only by a proxy, or once a client has a
    key. ``tile_origins`` are the sites of tiles.
    ``note_answer`` gets the status of each answer.
    """

    def __init__(
        self,
        app: ASGIApp,
        *,
        hosts: Iterable[str],
        users: Users,
        sessions: Sessions,
        is_open: bool,
        behind_tls: Iterable[str] = (),
        tile_origins: tuple[str, ...] = (),
        note_answer: Callable[[int], None] = lambda _status: None,
    ) -> None:
        self._app = app
        self._hosts = frozenset(hosts)
        self._behind_tls = frozenset(behind_tls)
        self._users = users
        self._sessions = sessions
        self._is_open = is_open
        self._tile_origins = tile_origins
        self._note_answer = note_answer
        self._rates = Rates()
        self._large = asyncio.Semaphore(LARGE_ONES)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or pass it on."""
        if scope["type"] != "http":
            if scope["type"] == "lifespan":
                await self._app(scope, receive, send)
            return

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                self._note_answer(message["status"])
                message["headers"] = [*message.get("headers", ()), *self._headers()]
            await send(message)

        # nothing here needs parts of files, and thousands of parts cost much
        scope["headers"] = [each for each in scope["headers"] if each[0].lower() != b"range"]
        try:
            length = self._check(scope)
        except Problem as problem:
            if self._rates.wait_of(f"refused {scope['client'][0]}"):
                problem.headers["connection"] = "close"  # with all that is pipelined behind it
                await asyncio.sleep(SLOWED)  # a flood waits, and others are answered
            await problem.response()(scope, receive, guarded)
            return
        if length <= SMALL_BODY:  # also one that does not say how long it is
            await self._app(scope, _limited(receive, most=SMALL_BODY), guarded)
            return
        try:
            async with asyncio.timeout(BODY_WITHIN):
                await self._large.acquire()
        except TimeoutError:
            busy = Problem(503, "Busy", "too many files at a time: try again")
            await busy.response()(scope, receive, guarded)
            return
        try:
            await self._app(scope, _limited(receive, most=length), guarded)
        finally:
            self._large.release()

    def _headers(self) -> list[tuple[bytes, bytes]]:
        if not self._tile_origins:
            return RAW_HEADERS
        policy = HEADERS["content-security-policy"].replace(
            "img-src 'self'", f"img-src 'self' {' '.join(self._tile_origins)}"
        )
        return [(b"content-security-policy", policy.encode()), *RAW_HEADERS[1:]]

    def _check(self, scope: Scope) -> int:
        """Raise Problem if a request must not pass; else store its identity in its state.

        Return the announced length of its body, 0 without one.
        """
        headers = _headers_of(scope)
        host = headers.get("host", "").lower()
        if host not in self._hosts:
            words = f"this server is not called {host[:80]!r}; name it with --name"
            raise Problem(421, "Wrong host", words)
        if scope["method"] not in METHODS:
            raise Problem(405, "Method not allowed", f"{scope['method'][:20]}: not used here")
        if scope["method"] == "HEAD" and scope["path"].startswith(API):
            raise Problem(405, "Method not allowed", "HEAD: the API does not take it")
        if scope["method"] not in SAFE:
            schemes = ("http", "https") if host in self._behind_tls else ("http",)
            _check_origin(headers, {f"{scheme}://{host}" for scheme in schemes})
        elif scope["path"].startswith(API):  # or a page elsewhere could use up the user's requests
            _check_site(headers)
        length = _length_of(headers, most=_most_bytes(scope["path"]))
        identity, session = self._identity(scope, headers)
        scope.setdefault("state", {})
        scope["state"]["identity"], scope["state"]["session"] = identity, session
        if not scope["path"].startswith((API, METRICS)):
            return length
        is_login = scope["path"] == SESSION and scope["method"] == "POST"
        if identity is None and not is_login:
            raise Problem(401, "Not logged in", NO_TOKEN, headers={"www-authenticate": "Bearer"})
        is_stop = scope["path"] == STOP and scope["method"] == "POST"
        if not is_stop:  # STOP is never rate-limited
            who = scope["client"][0] if identity is None else identity.name
            if scope["path"].endswith(PAUSE) and scope["method"] == "POST":
                who = f"pause {who}"  # no other requests keep a pause back
            wait = self._rates.wait_of(who)
            if wait:
                words = f"too many requests: try again in {wait} s"
                raise Problem(429, "Too many requests", words, headers={"retry-after": str(wait)})
        return length

    def _identity(
        self, scope: Scope, headers: dict[str, str]
    ) -> tuple[Identity | None, str | None]:
        """Return the identity of a request, and its session."""
        kind, _, text = headers.get("authorization", "").partition(" ")
        if kind.lower() == "bearer" and text:
            key = self._users.of_token(text)
            if key is None:
                raise Problem(401, "Unknown token", UNKNOWN, headers={"www-authenticate": "Bearer"})
            return Identity(key.name, key), None
        session = _cookie_of(headers.get("cookie", ""))
        key = None if session is None else self._sessions.key_of(session)
        if key is not None:
            return Identity(key.name, key), session
        is_local = self._is_open and not self._users.are_any and not _is_of_proxy(scope, headers)
        return (LOCAL if is_local else None), None


def _is_of_proxy(scope: Scope, headers: dict[str, str]) -> bool:
    """Return whether a proxy may have passed a request on: for a person who sits elsewhere."""
    is_told = any(name in PROXIES or name.startswith("x-forwarded-") for name in headers)
    return is_told or scope.get("http_version") == "1.0"  # nginx's default to who is behind it


def _headers_of(scope: Scope) -> dict[str, str]:
    """Return the headers of a request. Raise Problem if one of ONCE comes twice."""
    headers: dict[str, str] = {}
    for name, value in scope["headers"]:
        key = name.decode("latin-1").lower()
        if key in headers and key in ONCE:
            raise Problem(400, "Invalid request", f"two headers {key!r}")
        headers[key] = value.decode("latin-1")
    if "content-length" in headers and "transfer-encoding" in headers:
        # a proxy may believe the other one: what it takes for one request may be two here
        words = "send Content-Length or Transfer-Encoding, not both"
        raise Problem(400, "Invalid request", words, headers={"connection": "close"})
    return headers


def _check_origin(headers: dict[str, str], own: set[str]) -> None:
    """Raise Problem if a page of another origin than ours sent a request that changes something."""
    _check_site(headers)
    if headers.get("origin") not in (None, *own):
        raise _cross_site(headers)
    kind = headers.get("content-type", "").partition(";")[0].strip().lower()
    has_body = headers.get("content-length", "0") != "0" or "transfer-encoding" in headers
    if has_body and kind != "application/json":
        raise Problem(415, "Wrong media type", "expected Content-Type: application/json")


def _check_site(headers: dict[str, str]) -> None:
    """Raise Problem if a browser says that a page of another site sent the request."""
    if headers.get("sec-fetch-site", "same-origin") not in ("same-origin", "none"):
        raise _cross_site(headers)


def _cross_site(headers: dict[str, str]) -> Problem:
    words = f"a page of {headers.get('origin', 'another site')[:80]} may not do this"
    return Problem(403, "Cross-site request", words)


def _length_of(headers: dict[str, str], *, most: int) -> int:
    """Return the announced length of a body. Raise Problem if it is more than ``most`` bytes."""
    text = headers.get("content-length", "0")
    if not text.isdecimal() or int(text[:20]) > most:
        raise _too_large(most)
    return int(text)


def _limited(receive: Receive, *, most: int) -> Receive:
    """Return ``receive`` for a body; it raises Problem if that is too large or too slow."""
    taken = 0
    is_whole = False
    loop = asyncio.get_running_loop()
    until = loop.time() + BODY_WITHIN

    async def limited() -> Message:
        nonlocal taken, is_whole
        if is_whole:
            return await receive()
        try:
            async with asyncio.timeout_at(until):
                message: dict[str, Any] = dict(await receive())
        except TimeoutError:
            words = f"the body took more than {BODY_WITHIN:g} s"
            raise Problem(408, "Too slow", words) from None
        if message["type"] == "http.request":
            taken += len(message.get("body", b""))
            is_whole = not message.get("more_body", False)
            if taken > most:
                raise _too_large(most)
        return message

    return limited


def _most_bytes(path: str) -> int:
    return PLAN_BODY if path.startswith(API) and path.endswith(WITH_PLANS) else SMALL_BODY


def _too_large(most: int) -> Problem:
    return Problem(413, "Too large", f"expected a body of at most {most} bytes")


def _cookie_of(text: str) -> str | None:
    try:
        found = SimpleCookie(text).get(COOKIE)
    except CookieError:
        return None
    return None if found is None else found.value
