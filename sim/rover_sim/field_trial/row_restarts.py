"""Rows: the server ends or is killed, or the rover restarts, during a task; then it is resumed."""

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass

from mav_tasks.basics.errors import ClientError, NoAnswer, Refused
from mav_tasks.client.handle import Task
from mav_tasks.kinds import Move
from mav_tasks.tasks.lifecycle import TaskState
from rover_sim.field_trial.rows import Row, judged, not_tried
from rover_sim.field_trial.session import Session, TrialError
from rover_sim.field_trial.track import Place

DISTANCE = 5.0  # m
DONE = 2.0  # m, after which the event happens
HELD_WITHIN = 30.0  # s, for the task to be held
BACK_WITHIN = 90.0  # s, for a restarted rover: ArduPilot arms 41 s later
FINISHED_WITHIN = 120.0  # s
AGAIN = 2.0  # s between two attempts


@dataclass(frozen=True, slots=True)
class Event:
    """An event during a task."""

    name: str
    words: str
    is_exact: bool  # whether the remainder is measured


END = Event("restart", "orderly restart (SIGTERM) in mid-move", is_exact=True)
KILL = Event("kill", "SIGKILL in mid-move", is_exact=True)
REBOOT = Event("reboot", "the rover restarts in mid-task", is_exact=False)


async def restart(session: Session) -> Row:
    """End the server in order, start another one on its store, release the remainder."""

    async def happens() -> str:
        await session.disconnect()
        await session.ground.end_server()
        # its own estimate comes by way of the server, which has ended
        stood = session.ground.truth is None or session.track.stands(window=0.3)
        await session.ground.start_server()
        await session.connect()
        return "" if stood else "still moved when the server was gone; "

    return await _interrupted(session, END, happens)


async def kill(session: Session) -> Row:
    """Kill the server, start another one on its store, release the remainder."""

    async def happens() -> str:
        await session.disconnect()
        await session.ground.kill_server()
        await asyncio.sleep(1.0)
        await session.ground.start_server()
        await session.connect()
        return ""

    return await _interrupted(session, KILL, happens)


async def reboot(session: Session) -> Row:
    """Restart the rover, and finish the task after its release."""
    if not session.ground.can_reboot:
        return not_tried(REBOOT.name, REBOOT.words, "no way to restart it (--reboot-command)")

    async def happens() -> str:
        await session.ground.reboot()
        await asyncio.sleep(2.0)
        await session.until(_is_heard(session), within=BACK_WITHIN, what="the rover again")
        return ""

    return await _interrupted(session, REBOOT, happens)


async def _interrupted(
    session: Session, event: Event, happens: Callable[[], Awaitable[str]]
) -> Row:
    limit = f"{session.limits.remainder * 100:g} cm" if event.is_exact else "finished"
    try:
        await session.rest()
        task = await session.submit(Move(DISTANCE))
        begun = await session.running_since(task, DONE, within=90.0)
        note = await happens()
        await _halted(session, task)
        stood = await session.rest()
        session.say(f"  {event.name}: stands {stood.apart(begun):.2f} m from the beginning")
        await _let_go_on(session, task)
        end = await session.outcome(task, within=FINISHED_WITHIN)
        after = await session.rest()
        if not end.is_completed:
            await session.clean()
    except (TrialError, ClientError) as error:
        with suppress(TrialError, ClientError):
            await session.clean()
        return judged(event.name, event.words, result=str(error), limit=limit, holds=False)
    wrong = _wrong(begun, after)
    holds = end.is_completed and not note
    holds = holds and (not event.is_exact or abs(wrong) <= session.limits.remainder)
    # a simulated rover restarts at its start pose, so the distance means nothing
    figure = f"{wrong * 100:+.1f} cm" if event.is_exact else ""
    return judged(
        event.name, event.words, result=f"{note}{end}", figure=figure, limit=limit, holds=holds
    )


def _wrong(begun: Place, after: Place) -> float:
    return after.apart(begun) - DISTANCE


async def _halted(session: Session, task: Task) -> None:
    """Wait until the task waits for a person: held, or paused with its queue."""
    end = session.now + HELD_WITHIN
    while session.now < end:
        with suppress(NoAnswer):
            status = await session.client.status(task.id)
            if status.state in (TaskState.HELD, TaskState.PAUSED) or status.is_over:
                return
        await asyncio.sleep(0.5)
    raise TrialError(f"task {task.id} is neither held nor paused within {HELD_WITHIN:g} s")


async def _let_go_on(session: Session, task: Task) -> None:
    """Release the remainder of a held task, and resume the queue."""
    end = session.now + BACK_WITHIN
    if (await session.client.status(task.id)).state is TaskState.HELD:
        await _insist(lambda: session.client.release(task.id, "remainder"), session, end=end)
    if (await session.client.queue(limit=0)).paused is not None:
        await _insist(session.client.resume, session, end=end)


async def _insist(action: Callable[[], Awaitable[object]], session: Session, *, end: float) -> None:
    """Repeat an action while it is refused. Raise TrialError after ``end``."""
    while True:
        try:
            await action()
        except (Refused, NoAnswer) as error:
            if session.now >= end:
                raise TrialError(str(error)) from error
            session.say(f"  refused for now: {error}")
            await asyncio.sleep(AGAIN)
        else:
            return


def _is_heard(session: Session) -> Callable[[], bool]:
    def is_heard() -> bool:
        rover = session.rover
        return rover is not None and rover.is_heard

    return is_heard
