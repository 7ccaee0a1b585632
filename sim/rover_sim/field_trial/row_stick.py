"""Rows: a person pushes the throttle stick forward while a task starts, drives or is cancelled."""

import asyncio
from enum import Enum

from mav_tasks.basics.errors import ClientError
from mav_tasks.kinds import Move
from rover_sim.field_trial.rows import Row, judged, not_tried
from rover_sim.field_trial.session import Session, TrialError, quietly

NAME = "stick"
ASKED = "throttle stick forward"
FORWARD = 1700  # µs
WATCHED = 12.0  # s
LONG = 8.0  # m, of a move that lasts longer than the push


class Moment(Enum):
    """The moment of the push."""

    STARTING = "starting"
    DRIVING = "driving"
    CANCELLED = "cancelled"


async def stick(session: Session) -> list[Row]:
    """Push the stick in each of the three moments."""
    rows = []
    for moment in Moment:
        asked = f"{ASKED}, task {moment.value}"
        if session.is_px4:
            rows.append(not_tried(f"{NAME} {moment.value}", asked, "PX4 does not add the stick"))
        elif not session.ground.can_push_stick:
            rows.append(not_tried(f"{NAME} {moment.value}", asked, "no second link (--stick)"))
        else:
            rows.append(await _push(session, moment, asked))
    return rows


async def _push(session: Session, moment: Moment, asked: str) -> Row:
    name, limit = f"{NAME} {moment.value}", session.limits.stick
    await session.rest()
    try:
        pushed = await _bring_about(session, moment)
        await asyncio.sleep(WATCHED)
        seconds = session.track.stood_after(pushed)
        metres = session.track.travelled(pushed)
    except (TrialError, ClientError) as error:
        session.ground.push_stick(None)
        await session.clean()
        return judged(name, asked, result=str(error), limit=f"{limit:g} s", holds=False)
    session.ground.push_stick(None)
    await session.clean()
    stood = "still moves" if seconds is None else "stands"
    figure = f"{metres:.2f} m" if seconds is None else f"{seconds:.2f} s, {metres:.2f} m"
    holds = seconds is not None and seconds <= limit
    return judged(name, asked, result=stood, figure=figure, limit=f"{limit:g} s", holds=holds)


async def _bring_about(session: Session, moment: Moment) -> float:
    """Wait for the moment and push the stick; return the time."""
    if moment is Moment.STARTING:
        session.ground.push_stick(FORWARD)
        pushed = session.now
        await quietly(lambda: session.submit(Move(LONG)))
        return pushed
    task = await session.submit(Move(LONG))
    await session.running_since(task, 1.0, within=60.0)
    if moment is Moment.CANCELLED:
        await task.cancel()
        await asyncio.sleep(0.1)
    session.ground.push_stick(FORWARD)
    return session.now
