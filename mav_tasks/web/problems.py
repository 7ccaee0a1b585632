"""Errors of the API as problem details. RFC 9457."""

from collections.abc import Mapping

from starlette.responses import JSONResponse

from mav_tasks.basics.errors import (
    ClientError,
    MavTasksError,
    NoAnswer,
    NoSuchVehicle,
    PlanFileError,
    Refused,
    SettingError,
    UsageError,
)
from mav_tasks.client.descriptions import with_resume
from mav_tasks.tasks.lifecycle import TaskReason

MEDIA_TYPE = "application/problem+json"

_STATUS = {
    TaskReason.NOT_FOUND: 404,
    TaskReason.BAD_PARAMETER: 422,
    TaskReason.BAD_FRAME: 422,
    TaskReason.UNKNOWN_DEPENDENCY: 422,
    TaskReason.NOT_ALLOWED: 403,
    TaskReason.RATE_LIMITED: 429,
    TaskReason.STORE_UNAVAILABLE: 503,
}


class Problem(MavTasksError):
    """A refused or failed request; ``detail`` says what to change."""

    def __init__(
        self,
        status: int,
        title: str,
        detail: str,
        *,
        reason: str | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> None:
        super().__init__(detail)
        self.status, self.title, self.detail = status, title, detail
        self.reason = reason
        self.headers = dict(headers or {})

    def response(self) -> JSONResponse:
        """Return the answer to the request."""
        body = {
            "type": "about:blank",
            "title": self.title,
            "status": self.status,
            "detail": self.detail.encode(errors="backslashreplace").decode(),  # it quotes requests
            "reason": self.reason,
        }
        return JSONResponse(
            body, status_code=self.status, headers=self.headers, media_type=MEDIA_TYPE
        )


def invalid(detail: str) -> Problem:
    """Return the problem of an invalid request."""
    return Problem(422, "Invalid request", detail)


def not_found(detail: str) -> Problem:
    """Return the problem of a request for something that does not exist."""
    return Problem(404, "Not found", detail, reason="not_found")


def problem_of(error: Exception) -> Problem:
    """Return an error of the client library as a problem."""
    match error:
        case Problem():
            return error
        case NoAnswer():
            return Problem(504, "The task server did not answer", str(error))
        case NoSuchVehicle():
            return not_found(str(error))
        case Refused(reason=number):
            is_known = number in TaskReason._value2member_map_
            reason = TaskReason(number) if is_known else TaskReason.NONE
            status = _STATUS.get(reason, 409)
            name = reason.name.lower() if reason else None
            words = with_resume(str(error), "press Resume")
            return Problem(status, "The task server refused", words, reason=name)
        case PlanFileError() | SettingError() | ValueError():
            return invalid(str(error))
        case ClientError() | UsageError():  # a connection to the server that cannot be opened
            return Problem(409, "Not done", str(error))
        case _:
            raise error
