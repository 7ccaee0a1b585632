"""An operation of the API: declared once, for its route, its checks and the OpenAPI document."""

from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from starlette.convertors import Convertor, register_url_convertor
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from mav_tasks.basics.errors import MavTasksError, SettingError
from mav_tasks.config.setting_keys.parts import Part, shortened
from mav_tasks.tasks.task import MAX_TASK_ID
from mav_tasks.web.bodies import read
from mav_tasks.web.identity import LOCAL, Identity
from mav_tasks.web.problems import not_found, problem_of

ROOT = "/api/v1"
MAX_VEHICLE = 255  # system ids of MAVLink
WORDS = {"vehicle": "rover", "task": "task"}


class NumberConvertor(Convertor[int]):
    """A number in a path, of at most ten digits. A longer one is not found."""

    regex = "[0-9]{1,10}"

    def convert(self, value: str) -> int:
        """Return the number."""
        return int(value)

    def to_string(self, value: int) -> str:
        """Return the text of a number."""
        return str(value)


register_url_convertor("number", NumberConvertor())


@dataclass(frozen=True, slots=True)
class Call:
    """A request that has passed all checks. ``body`` has all declared parts."""

    identity: Identity
    session: str | None
    path: Mapping[str, int | str]
    query: Mapping[str, Any]
    body: Mapping[str, Any]
    headers: Mapping[str, str]

    @property
    def vehicle(self) -> int:
        """The rover that the path names."""
        return int(self.path["vehicle"])

    @property
    def task(self) -> int:
        """The task that the path names."""
        return int(self.path["task"])


#: returns a JSON value, a Response, or None for an answer without contents
Handler = Callable[[Call], Awaitable[Any]]


@dataclass(frozen=True, slots=True)
class Operation:
    """``path`` is below ROOT; "{vehicle}" and "{task}" in it are numbers.

    ``body``: None: the request has none. ``reading``: what reads more of it, one of READINGS.
    ``answer``: the name of the answer's schema; "": no contents. Whether a user may do it, the task
    server decides.
    """

    method: str
    path: str
    summary: str
    handler: Handler
    query: Sequence[Part] = ()
    body: Sequence[Part] | None = None
    answer: str = ""
    status: int = 200
    headers: Sequence[Part] = ()
    description: str = ""
    reading: str = ""

    async def run(self, request: Request) -> Response:
        """Answer a request."""
        try:
            result = await self.handler(await self._call(request))
        except (MavTasksError, ValueError) as error:
            return problem_of(error).response()
        if isinstance(result, Response):
            return result
        if result is None:
            return Response(status_code=204)
        return JSONResponse(result, status_code=self.status, headers={"cache-control": "no-store"})

    async def _call(self, request: Request) -> Call:
        for name, most in (("vehicle", MAX_VEHICLE), ("task", MAX_TASK_ID)):
            number = request.path_params.get(name)
            if number is not None and not 1 <= number <= most:
                raise not_found(f"there is no {WORDS[name]} {number}: ids are 1 to {most}")
        body: Mapping[str, Any] = {}
        if self.body is not None:
            body = await read(await request.body(), self.body, self.reading)
        return Call(
            request.state.identity or LOCAL,  # None: only to log in
            request.state.session,
            request.path_params,
            {part.name: _queried(part, request.query_params) for part in self.query},
            body,
            request.headers,
        )


def _queried(part: Part, query: Mapping[str, str]) -> Any:
    text = query.get(part.name)
    try:
        plain = None if text is None else part.shape.read(text)
    except SettingError as error:
        raise SettingError(f"{part.name} {shortened(text)}: {error}") from None
    return part.read({part.name: plain})
