"""Row: tasks that are submitted in the first five seconds of the rover's boot."""

import asyncio
from contextlib import suppress

from mav_tasks.basics.errors import ClientError, NoAnswer, Refused
from mav_tasks.client.handle import Task
from mav_tasks.kinds import Move
from rover_sim.field_trial.rows import Row, judged, not_tried
from rover_sim.field_trial.session import Session, TrialError

NAME = "boot"
ASKED = "3 tasks in the first 5 s of the boot"
GOALS = (Move(0.5), Move(1.0), Move(0.3))
BACK_WITHIN = 60.0  # s
GONE = 1.5  # s until the rover boots; before, the server has no rover for a task
DRIVEN_WITHIN = 180.0  # s; below the server's watch.ready_timeout


async def boot(session: Session) -> Row:
    """Restart the idle rover, and submit at once."""
    if not session.ground.can_reboot:
        return not_tried(NAME, ASKED, "no way to restart it (--reboot-command)")
    await session.rest()
    begun = session.now
    await session.ground.reboot()
    await asyncio.sleep(GONE)
    tasks: list[Task] = []
    refusal = ""
    while len(tasks) < len(GOALS) and session.now < begun + BACK_WITHIN:
        try:
            tasks.append(await session.client.submit(GOALS[len(tasks)]))
        except (Refused, NoAnswer) as error:
            refusal = str(error)
        await asyncio.sleep(0.5)
    submitted = session.now - begun
    session.say(f"  {len(tasks)} tasks taken {submitted:.1f} s after the restart; {refusal}")
    try:
        ends = [await session.outcome(task, within=DRIVEN_WITHIN) for task in tasks]
    except TrialError as error:
        return judged(NAME, ASKED, result=str(error), holds=False)
    with suppress(ClientError):
        paused = (await session.client.queue(limit=0)).paused
        if paused is not None:
            session.say(f"  the queue is paused: {paused.name}")
    holds = len(ends) == len(GOALS) and all(end.is_completed for end in ends)
    result = ", ".join(str(end) for end in ends) or f"none taken: {refusal}"
    if not holds:
        await session.clean()
    figure = f"submitted within {submitted:.1f} s"
    return judged(NAME, ASKED, result=result, figure=figure, limit="all driven", holds=holds)
