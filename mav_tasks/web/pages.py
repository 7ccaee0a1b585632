"""The page's files: our own from this package, Leaflet's from its package, and tiles."""

from collections.abc import Awaitable, Callable
from importlib.util import find_spec
from pathlib import Path

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from mav_tasks.basics.errors import UsageError, missing
from mav_tasks.web.tiles import Tiles

STATIC = Path(__file__).parent / "static"
FRESH = {"cache-control": "no-cache"}  # asks each time whether it has changed: it is near
Page = Callable[[Request], Awaitable[Response]]


class Files(StaticFiles):
    """Static files that a browser does not take from its cache after an update."""

    def file_response(self, *args: object, **named: object) -> Response:
        """Return a file, or that it has not changed."""
        response = super().file_response(*args, **named)  # type: ignore[arg-type]
        response.headers.update(FRESH)
        return response


def routes(tiles: Tiles | None) -> list[Route | Mount]:
    """Return the routes of the page. Raise UsageError if a package is missing."""

    async def index(_request: Request) -> Response:
        return FileResponse(STATIC / "index.html", headers=FRESH)

    async def reference(_request: Request) -> Response:
        return FileResponse(STATIC / "api.html", headers=FRESH)

    async def tile(request: Request) -> Response:
        if tiles is None:
            return Response(status_code=404)
        place = (request.path_params[name] for name in ("zoom", "column", "row"))
        found = await run_in_threadpool(tiles.tile, *place)
        if found is None:  # a hole in the file is no error that a browser should log
            return Response(status_code=204)
        data, kind = found
        return Response(data, media_type=kind, headers={"cache-control": "max-age=86400"})

    return [
        Route("/", index),
        Route("/api", reference),
        Route("/tasks/{task:number}", index),
        Route("/tiles/{zoom:number}/{column:number}/{row:number}", tile),
        Mount("/static/leaflet", Files(directory=_leaflet())),
        Mount("/static", Files(directory=STATIC)),
    ]


def _leaflet() -> Path:
    """Return the folder of Leaflet's files."""
    try:
        found = find_spec("xstatic.pkg.leaflet")
    except ModuleNotFoundError:
        found = None
    if found is None or found.origin is None:
        raise UsageError(f"the web page {missing('XStatic-Leaflet', 'web')}")
    return Path(found.origin).parent / "data"
