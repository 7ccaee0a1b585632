"""Rows: the server ends or is killed, or the rover restarts, in the middle of a task or before."""

import asyncio
from collections.abc import Awaitable, Callable

from mav_tasks.basics.errors import NoAnswer, Refused
from mav_tasks.client.handle import Task
from mav_tasks.kinds import Move
from mav_tasks.tasks.lifecycle import TaskState
from rover_sim.trial.session import NotTried, Result, Session, TrialError

DISTANCE = 5.0  # m
DONE = 2.0  # m, after which it happens
HELD_WITHIN = 30.0  # s, for the task to be held
BACK_WITHIN = 90.0  # s, for a restarted rover: ArduPilot arms 41 s later
FINISHED_WITHIN = 120.0  # s
AGAIN = 2.0  # s between two attempts
IN_BOOT = (Move(0.5), Move(1.0), Move(0.3))
GONE = 1.5  # s until the rover boots; before, the server has no rover for a task
TAKEN_WITHIN = 60.0  # s
DRIVEN_WITHIN = 180.0  # s; below the server's watch.ready_timeout


async def boot(session: Session) -> Result:
    """Restart the idle rover, and submit at once."""
    _need_reboot(session)
    await session.rest()
    begun = session.now
    await session.ground.reboot()
    await asyncio.sleep(GONE)
    tasks: list[Task] = []
    refusal = ""
    while len(tasks) < len(IN_BOOT) and session.now < begun + TAKEN_WITHIN:
        try:
            tasks.append(await session.client.submit(IN_BOOT[len(tasks)]))
        except (Refused, NoAnswer) as error:
            refusal = str(error)
        await asyncio.sleep(0.5)
    figure = f"submitted within {session.now - begun:.1f} s"
    ends = [await session.outcome(task, within=DRIVEN_WITHIN) for task in tasks]
    holds = len(ends) == len(IN_BOOT) and all(end.is_completed for end in ends)
    words = ", ".join(map(str, ends)) or f"none taken: {refusal}"
    return Result(words, holds, figure, "all driven")


async def restart(session: Session, *, is_killed: bool) -> Result:
    """End the server in order or kill it, start another one on its store, release the remainder."""

    async def happens() -> str:
        server = session.ground.server
        await session.disconnect()
        await (server.kill() if is_killed else server.end())
        # its own estimate comes by way of the server, which has ended
        is_known = session.ground.truth is not None and not is_killed
        moved = is_known and not session.track.stands(window=0.3)
        await session.begin()
        return "still moved when the server was gone; " if moved else ""

    return await _interrupted(session, happens, is_exact=True)


async def reboot(session: Session) -> Result:
    """Restart the rover, and finish the task after its release."""
    _need_reboot(session)

    async def happens() -> str:
        await session.ground.reboot()
        await asyncio.sleep(2.0)
        await session.until(session.is_found, within=BACK_WITHIN, what="the rover again")
        return ""

    return await _interrupted(session, happens, is_exact=False)


def _need_reboot(session: Session) -> None:
    if not session.ground.can_reboot:
        raise NotTried("no way to restart it (--reboot-command, --stick)")


async def _interrupted(
    session: Session, happens: Callable[[], Awaitable[str]], *, is_exact: bool
) -> Result:
    """``is_exact``: the end is measured; a simulated rover restarts at its start pose."""
    await session.rest()
    task = await session.submit(Move(DISTANCE))
    begun = await session.running_since(task, DONE)
    note = await happens()
    await _insist(session, lambda: _stopped(session, task), within=HELD_WITHIN)
    stood = await session.rest()
    session.say(f"  stands {stood.apart(begun):.2f} m from the beginning")
    if (await session.client.status(task.id)).state is TaskState.HELD:
        await _insist(session, lambda: session.client.release(task.id, "remainder"))
    if (await session.client.queue(limit=0)).paused is not None:
        await _insist(session, session.client.resume)
    end = await session.outcome(task, within=FINISHED_WITHIN)
    wrong = (await session.rest()).apart(begun) - DISTANCE
    holds = end.is_completed and not note
    if not is_exact:
        return Result(str(end), holds, limit="finished")
    most = session.limits.remainder
    figure = f"end error {wrong * 100:+.1f} cm"
    return Result(f"{note}{end}", holds and abs(wrong) <= most, figure, f"{most * 100:g} cm")


async def _stopped(session: Session, task: Task) -> None:
    """Raise NoAnswer unless the task waits for a person: held, paused, or over."""
    status = await session.client.status(task.id)
    if not (status.is_over or status.state in (TaskState.HELD, TaskState.PAUSED)):
        raise NoAnswer(f"task {task.id} is neither held nor paused")


async def _insist(
    session: Session, action: Callable[[], Awaitable[object]], *, within: float = BACK_WITHIN
) -> None:
    """Repeat an action while it is refused. Raise TrialError after ``within`` seconds."""
    end = session.now + within
    while True:
        try:
            await action()
        except (Refused, NoAnswer) as error:
            if session.now >= end:
                raise TrialError(f"{error}, {within:g} s long") from error
        else:
            return
        await asyncio.sleep(AGAIN)
