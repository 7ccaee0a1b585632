"""Parses the mission files of requests."""

from collections.abc import Callable
from typing import Any

from starlette.responses import JSONResponse

from mav_tasks.basics.errors import PlanFileError
from mav_tasks.config.setting_keys.parts import Part
from mav_tasks.config.setting_keys.shapes import Text
from mav_tasks.engine.services.missions import CAPACITY
from mav_tasks.plans import PlanFile, parse_plan
from mav_tasks.web.plan_preview import preview_of

LONGEST = 6_000_000  # characters; QGroundControl writes some 900 for an item
MOST_LINES = 200_000  # QGroundControl writes some 30 for an item
Parts = dict[str, Any]
NAME = Part("name", Text("a name", most=255), "name of the file, for messages")


def text_part(meaning: str, *, is_required: bool = True) -> Part:
    """Return the part of a request that has a file's text."""
    return Part("text", Text("a file's contents", least=1, most=LONGEST), meaning, is_required)


def _with_plan(body: Parts) -> Parts:
    """Return the parts of a request, with "plan" in place of the text, if there is one.

    Raise PlanFileError, with the file's name, if it is invalid.
    """
    return body | ({} if body["text"] is None else {"text": "", "plan": _parsed(body)})


def _with_preview(body: Parts) -> Parts:
    """Return the "answer", JSON, that shows the file of a request; raise as above."""
    return {"answer": bytes(JSONResponse(preview_of(_parsed(body))).body).decode()}


def _parsed(body: Parts) -> PlanFile:
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


#: what reads more of a body than its JSON
READINGS: dict[str, Callable[[Parts], Parts]] = {
    "": lambda body: body,
    "plan": _with_plan,
    "preview": _with_preview,
}
