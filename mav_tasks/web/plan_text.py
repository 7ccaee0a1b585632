"""Parses the mission files of requests."""

from typing import Any

from starlette.responses import JSONResponse

from mav_tasks.errors import PlanFileError
from mav_tasks.plan_files import PlanFile, parse_plan
from mav_tasks.services.mission_receiver import CAPACITY
from mav_tasks.web.fields import Field
from mav_tasks.web.plan_preview import preview_of

LONGEST = 6_000_000  # characters; QGroundControl writes some 900 for an item
MOST_LINES = 200_000  # QGroundControl writes some 30 for an item
NAME = Field("name", "string", "name of the file, for messages", False, 0, 255)


def text_field(meaning: str, *, is_required: bool = True) -> Field:
    """Return the part of a request that has a file's text."""
    return Field("text", "string", meaning, is_required, 1, LONGEST)


def with_plan(body: dict[str, Any]) -> dict[str, Any]:
    """Return the parts of a request, with "plan" in place of the text, if there is one.

    Raise PlanFileError, with the file's name, if it is invalid.
    """
    return body | ({} if body["text"] is None else {"text": "", "plan": _parsed(body)})


def with_preview(body: dict[str, Any]) -> dict[str, Any]:
    """Return the "answer" that shows the file of a request. Raise PlanFileError as above."""
    return {"answer": JSONResponse(preview_of(_parsed(body))).body}


def _parsed(body: dict[str, Any]) -> PlanFile:
    text, name = body["text"], body["name"] or "text"
    try:
        if text.count("\n") > MOST_LINES:
            raise PlanFileError(f"more than {MOST_LINES} lines")
        plan = parse_plan(text)
        if len(plan.items) > CAPACITY:
            raise PlanFileError(f"{len(plan.items)} items; the task server takes {CAPACITY}")
    except PlanFileError as error:
        raise PlanFileError(f"{name}: {error}") from None
    return plan
