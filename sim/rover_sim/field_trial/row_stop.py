"""Row: STOP at 1 m/s, compared with the shorter of zeros and HOLD, measured just before."""

import asyncio
from statistics import median

from mav_tasks.basics.errors import Refused
from mav_tasks.kinds import Drive
from rover_sim.field_trial.pilot import Pilot, Way, better
from rover_sim.field_trial.rows import Row, judged, not_tried
from rover_sim.field_trial.session import Session

NAME = "stop"
ASKED = "STOP at 1 m/s"
SPEED = 1.0  # m/s
RUN_UP = 5.0  # s; the slowest recorded rover needs 4 s
RUNS = 3  # of each way
BRAKES = 6.0  # s


async def measure_ways(session: Session) -> float | None:
    """Measure zeros and HOLD without the server; return the shorter distance in metres, or None."""
    link = session.ground.rover_link()
    if link is None:
        return None
    pilot = Pilot(link, session.ground.truth)
    try:
        distances: dict[Way, list[float]] = {way: [] for way in Way}
        for _ in range(RUNS):
            for way in Way:
                metres = await pilot.stopping(way, speed=SPEED, seconds=RUN_UP)
                if metres is not None:
                    distances[way].append(metres)
        for way, values in distances.items():
            session.say(f"  {way.value}: {', '.join(f'{value:.2f}' for value in values)} m")
        return better(distances, median) if any(distances.values()) else None
    finally:
        await pilot.close()


async def stop(session: Session, *, best: float | None) -> Row:
    """Drive at 1 m/s and send STOP."""
    if best is None:
        return not_tried(
            NAME, ASKED, "the shortest stopping distance is not known (--stop-distance)"
        )
    metres: list[float] = []
    wrong = ""
    for _ in range(RUNS):
        try:
            metres.append(await _stop_once(session))
        except Refused as refused:
            wrong = str(refused)
        await session.clean()
    allowed = session.limits.stop
    holds = len(metres) == RUNS and median(metres) <= allowed * best
    shown = ", ".join(f"{value:.2f}" for value in metres)
    figure = f"{shown} m beside {best:.2f} m" + (
        f" = {median(metres) / best:.2f}" if metres else ""
    )
    result = wrong or f"stopped {len(metres)} times"
    return judged(NAME, ASKED, result=result, figure=figure, limit=f"{allowed:g} x", holds=holds)


async def _stop_once(session: Session) -> float:
    task = await session.submit(Drive(SPEED, 0.0, 3 * RUN_UP))
    await session.running_since(task, 0.1, within=60.0)
    await asyncio.sleep(RUN_UP)
    begun = session.track.last
    await session.client.stop()
    await asyncio.sleep(BRAKES)
    await session.rest()
    return session.track.last.apart(begun)
