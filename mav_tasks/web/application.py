"""The web application: the API's operations and the page, inside the guard."""

from collections.abc import Iterable
from typing import Any

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp

from mav_tasks.metrics.exposition import CONTENT_TYPE
from mav_tasks.web import api_asked, api_past, api_rovers, api_session, api_tasks, pages
from mav_tasks.web.figures import Figures
from mav_tasks.web.guard import Guard
from mav_tasks.web.openapi import document_of
from mav_tasks.web.operation import ROOT, Operation
from mav_tasks.web.problems import Problem
from mav_tasks.web.services import Services


def operations_of(services: Services) -> list[Operation]:
    """Return all operations of the API."""
    parts = (api_session, api_rovers, api_tasks, api_asked, api_past)
    return [operation for part in parts for operation in part.operations(services)]


def application(
    services: Services,
    *,
    hosts: Iterable[str],
    behind_tls: Iterable[str],
    is_open: bool,
) -> ASGIApp:
    """Return the application. The other arguments are as in Guard."""
    operations = operations_of(services)
    document = document_of(operations)

    async def openapi(_request: Request) -> Response:
        return JSONResponse(document)

    figures = Figures(services.live)

    async def metrics(_request: Request) -> Response:
        return Response(figures.text(), headers={"content-type": CONTENT_TYPE})

    async def healthz(_request: Request) -> Response:
        return PlainTextResponse("ok\n")

    async def readyz(_request: Request) -> Response:
        is_ready = services.live.is_reachable  # where the server is, only users may know
        words = "ready\n" if is_ready else "no answer from the task server\n"
        return PlainTextResponse(words, status_code=200 if is_ready else 503)

    app = Starlette(
        routes=[
            *(_route(operation) for operation in operations),
            Route(f"{ROOT}/openapi.json", openapi),
            Route("/metrics", metrics),
            Route("/healthz", healthz),
            Route("/readyz", readyz),
            *pages.routes(services.tiles),
        ],
        exception_handlers={HTTPException: _failed, 500: _broken},
    )
    return Guard(
        app,
        hosts=hosts,
        behind_tls=behind_tls,
        users=services.users,
        sessions=services.sessions,
        is_open=is_open,
        tile_origins=() if services.tiles is None else services.tiles.origins,
        note_answer=figures.note_answer,
    )


def _route(operation: Operation) -> Route:
    path = operation.path
    for name in ("vehicle", "task"):
        path = path.replace(f"{{{name}}}", f"{{{name}:number}}")
    return Route(f"{ROOT}{path}", operation.run, methods=[operation.method])


async def _failed(_request: Request, error: Any) -> Response:
    words = {404: "there is nothing at this address", 405: "this address does not take that method"}
    detail = words.get(error.status_code, str(error.detail))
    headers = dict(error.headers or {})
    return Problem(error.status_code, str(error.detail), detail, headers=headers).response()


async def _broken(_request: Request, _error: Exception) -> Response:
    return Problem(500, "Internal error", "a fault of the web process: see its log").response()
