"""Operations of the session: show it, log in, log out; and the event stream."""

import time
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import aclosing, suppress
from importlib.metadata import version
from typing import Any

from starlette.responses import Response, StreamingResponse

from mav_tasks.basics.errors import UsageError
from mav_tasks.client.parts import KEY_TEXT
from mav_tasks.client.terms import CHANGES, NEW
from mav_tasks.config.setting_keys.parts import Part
from mav_tasks.config.setting_keys.shapes import Text
from mav_tasks.kinds.in_json import FORMS
from mav_tasks.mavlink.label import MAX_LABEL
from mav_tasks.tasks.task import DEFAULT_PRIORITY, MAX_PRIORITY
from mav_tasks.web.events import description
from mav_tasks.web.guard import UNKNOWN
from mav_tasks.web.operation import Call, Operation
from mav_tasks.web.problems import Problem
from mav_tasks.web.services import Services
from mav_tasks.web.sessions import COOKIE, LASTS

PIECE = 64 * 1024  # bytes that a connection keeps for a reader; others are shared
CHECKED = 1.0  # s between looks at the key of an open stream
TOKEN = Part("token", KEY_TEXT, "the token: what 'mav-tasks keys add' printed", True)


def operations(services: Services) -> list[Operation]:
    """Return the operations."""

    async def session(call: Call) -> object:
        with suppress(UsageError):  # who acts is told why
            await services.users.open(call.identity)  # before it is needed
        return {
            "name": call.identity.name,
            "role": call.identity.role,
            "may": call.identity.may,
            "version": version("mav-tasks"),
            "server": services.server,
            "instance": services.instance,
            "tiles": None if services.tiles is None else services.tiles.form,
            "journal": services.journal is not None and services.journal.is_readable(),
            "records": services.records is not None,
            "goals": [
                {
                    "kind": kind.name,
                    "title": kind.title,
                    "meaning": kind.meaning,
                    "numbers": [_part(number) for number in kind.numbers],
                }
                for kind in FORMS
            ],
            "terms": [_part(part) for part in NEW],
            "changes": [_part(part) for part in CHANGES],
            "priority": {"least": 0, "most": MAX_PRIORITY, "default": DEFAULT_PRIORITY},
            "label_bytes": MAX_LABEL,
        }

    async def log_in(call: Call) -> Response:
        key = services.users.of_token(call.body["token"])
        if key is None:
            raise Problem(401, "Unknown token", UNKNOWN)
        if call.session is not None:
            services.sessions.end(call.session)
        response = Response(status_code=204)
        number = services.sessions.begin(key)
        is_tls = call.headers.get("origin", "").startswith("https://")  # of a proxy
        response.set_cookie(
            COOKIE,
            number,
            max_age=int(LASTS),
            httponly=True,
            samesite="strict",
            path="/",
            secure=is_tls,
        )
        return response

    async def log_out(call: Call) -> Response:
        if call.session is not None:
            services.sessions.end(call.session)
        response = Response(status_code=204)
        response.delete_cookie(COOKIE, path="/", httponly=True, samesite="strict")
        return response

    async def events(call: Call) -> Response:
        last = call.headers.get("last-event-id")
        reader = services.live.hub.open(last, user=call.identity.name)
        return StreamingResponse(
            _while_it_may(call, reader.frames(), services),
            media_type="text/event-stream",
            headers={"cache-control": "no-store", "x-accel-buffering": "no"},
        )

    return [
        Operation("GET", "/session", "Who you are, and what you may do", session, answer="Session"),
        Operation("POST", "/session", "Log in with a token", log_in, body=[TOKEN]),
        Operation("DELETE", "/session", "Log out", log_out),
        Operation(
            "GET",
            "/events",
            "Changes of rovers, queues, tasks and texts, as server-sent events",
            events,
            answer="Events",
            headers=[Part("Last-Event-ID", Text("an id"), "id of the last event that you got")],
            description=description(),
        ),
    ]


def _part(part: Part) -> dict[str, Any]:
    schema = part.schema
    return {
        "name": part.name,
        "type": schema.get("type", "any"),
        "unit": part.shape.unit,
        "meaning": part.meaning,
        "required": part.is_required,
        "least": schema.get("minimum"),
        "most": schema.get("maximum", schema.get("maxLength")),
        "words": list(getattr(part.shape, "words", ())),
    }


async def _while_it_may(
    call: Call, frames: AsyncGenerator[bytes], services: Services
) -> AsyncIterator[bytes]:
    """Yield the frames of a stream until its key is revoked, or its session ends."""
    checked_at = time.monotonic()
    async with aclosing(frames):
        async for frame in frames:
            if time.monotonic() - checked_at > CHECKED:
                checked_at = time.monotonic()
                if not services.is_still_known(call):
                    return
            for at in range(0, len(frame), PIECE):
                yield frame[at : at + PIECE]
