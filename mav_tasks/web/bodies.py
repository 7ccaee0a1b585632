"""Reads the bodies of requests: large ones in a process of its own, for a STOP must not wait.

A thread is not enough: parsers written in C keep the interpreter's lock until they have finished.
The process ends with the request, and with it all memory that the request needed. It gets a line
that declares the parts, and the body behind it; it answers in JSON.
"""

import asyncio
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from mav_tasks.basics.errors import MavTasksError
from mav_tasks.config.setting_keys.parts import Part, read_all, shortened
from mav_tasks.config.setting_keys.shapes import Choice, Flag, Items, Number, Record, Text
from mav_tasks.plans.values import FenceCircle, FencePolygon, GeoPoint, PlanFile, PlanItem
from mav_tasks.web.guard import SMALL_BODY
from mav_tasks.web.plan_text import READINGS, Parts
from mav_tasks.web.problems import Problem, invalid, problem_of

MOST_PARTS = 300_000  # lists and objects of a body: a plan file of 6,000 items has some 20,000
WITHIN = 20.0  # s
NICE = 10  # it has time: the event loop comes first
COMMAND = (sys.executable, "-m", "mav_tasks.web.bodies")

SHAPES: dict[str, Any] = {
    kind.__name__: kind for kind in (Choice, Flag, Items, Number, Record, Text)
}

_one_at_a_time = asyncio.Lock()


async def read(data: bytes, parts: Sequence[Part], reading: str) -> Parts:
    """Return the declared parts of a body. Raise Problem, or what the reading raises.

    ``reading``: the name of one of READINGS.
    """
    if not reading and len(data) <= SMALL_BODY:
        return _read(data, parts, reading)
    async with _one_at_a_time:
        where = _read if len(data) <= SMALL_BODY else _read_apart
        return await asyncio.to_thread(where, data, parts, reading)


def _read(data: bytes, parts: Sequence[Part], reading: str) -> Parts:
    if data.count(b"[") + data.count(b"{") > MOST_PARTS:  # nothing here has so many
        raise Problem(413, "Too large", f"the body has more than {MOST_PARTS} parts")
    try:
        value = json.loads(data, object_pairs_hook=_object_of) if data else {}
    except Problem:
        raise
    except (ValueError, RecursionError) as error:
        raise Problem(400, "Invalid JSON", f"the request's body is not JSON: {error}") from None
    return READINGS[reading](read_all(parts, value))


def _object_of(parts: list[tuple[str, Any]]) -> Parts:
    """Return a JSON object. Raise Problem if a name comes twice: parsers differ in which counts."""
    found: Parts = {}
    for name, value in parts:
        if name in found:
            raise invalid(f"{shortened(name)[1:-1]}: it comes twice")
        found[name] = value
    return found


def _read_apart(data: bytes, parts: Sequence[Part], reading: str) -> Parts:
    declared = [
        (part.name, type(part.shape).__name__, asdict(part.shape), part.meaning, part.is_required)
        for part in parts
    ]
    head = json.dumps({"parts": declared, "reading": reading})
    try:
        ended = subprocess.run(
            COMMAND,
            input=head.encode() + b"\n" + data,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            timeout=WITHIN,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        words = f"it could not be read within {WITHIN:g} s: send less, or try again"
        raise Problem(503, "Busy", words) from None
    answer = json.loads(ended.stdout)
    if answer["problem"] is not None:
        raise Problem(*answer["problem"])
    found: Parts = answer["parts"]
    return found if answer["plan"] is None else found | {"plan": _plan_of(answer["plan"])}


def main() -> None:
    """Read the body on standard input; write its parts, or the parts of its Problem."""
    os.nice(NICE)
    head = json.loads(sys.stdin.buffer.readline())
    answer: dict[str, Any] = {"problem": None, "parts": None, "plan": None}
    try:
        parts = [
            Part(name, SHAPES[kind](**shape), meaning, is_required)
            for name, kind, shape, meaning, is_required in head["parts"]
        ]
        found = _read(sys.stdin.buffer.read(), parts, head["reading"])
        plan = found.pop("plan", None)
        answer |= {"parts": found, "plan": None if plan is None else _values_of(plan)}
    except (MavTasksError, ValueError) as error:
        problem = problem_of(error)
        answer["problem"] = problem.status, problem.title, problem.detail
    json.dump(answer, sys.stdout)


def _values_of(plan: PlanFile) -> list[Any]:
    """Return a file as JSON values, which ``_plan_of`` takes."""
    items = [
        (each.command, each.frame, each.params, each.x, each.y, each.z, each.autocontinue)
        for each in plan.items
    ]
    fence = [
        (each.inclusion, each.vertices, None)
        if isinstance(each, FencePolygon)
        else (each.inclusion, each.center, each.radius)
        for each in plan.fence
    ]
    return [items, plan.home, fence, plan.rally]


def _plan_of(values: list[Any]) -> PlanFile:
    items, home, fence, rally = values
    return PlanFile(
        tuple(
            PlanItem(command, frame, (params[0], params[1], params[2], params[3]), *rest)
            for command, frame, params, *rest in items
        ),
        None if home is None else GeoPoint(*home),
        tuple(
            FencePolygon(inside, tuple((point[0], point[1]) for point in places))
            if radius is None
            else FenceCircle(inside, (places[0], places[1]), radius)
            for inside, places, radius in fence
        ),
        tuple(GeoPoint(*point) for point in rally),
    )


if __name__ == "__main__":
    main()
