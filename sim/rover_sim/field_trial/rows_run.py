"""Runs the chosen rows; each leaves the rover ready for the next one."""

from collections.abc import Awaitable, Callable, Collection, Sequence

from mav_tasks.basics.errors import ClientError
from rover_sim.field_trial import row_boot, row_restarts, row_stick, row_stop, row_tasks
from rover_sim.field_trial.rows import Row, judged
from rover_sim.field_trial.session import Session, TrialError

NAMES = ("boot", "stop", "restart", "kill", "reboot", "tasks", "stick")


async def run_rows(
    session: Session,
    only: Collection[str] = NAMES,
    *,
    stop_distance: float | None = None,
    done: Callable[[Row], None] = lambda _row: None,
) -> Sequence[Row]:
    """Run rows, and call ``done`` with each; measure stop distances before the server starts."""
    best = stop_distance
    if "stop" in only and best is None:
        session.say("stop: measuring the shortest distance, without the server")
        best = await row_stop.measure_ways(session)
    await session.begin()
    singles: dict[str, Callable[[], Awaitable[Row]]] = {
        "tasks": lambda: row_tasks.drive_tasks(session),
        "stop": lambda: row_stop.stop(session, best=best),
        "restart": lambda: row_restarts.restart(session),
        "kill": lambda: row_restarts.kill(session),
        "reboot": lambda: row_restarts.reboot(session),
        "boot": lambda: row_boot.boot(session),
    }
    rows: list[Row] = []
    for name in NAMES:
        if name not in only:
            continue
        session.say(f"{name}:")
        try:
            found = await row_stick.stick(session) if name == "stick" else [await singles[name]()]
        except (ClientError, TrialError) as error:
            found = [judged(name, name, result=str(error), holds=False)]
        for row in found:
            done(row)
        rows += found
    return rows
