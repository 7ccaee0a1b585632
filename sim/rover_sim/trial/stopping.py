"""Rows: STOP at 1 m/s beside the rover's own ways to stop, and the throttle stick of a person."""

import asyncio
from contextlib import closing
from statistics import median

from pymavlink.dialects.v20 import development as mav

from mav_tasks.basics.errors import Refused
from mav_tasks.kinds import Drive, Move
from rover_sim.observing.driver import Driver, Interference
from rover_sim.observing.observer import Observer
from rover_sim.trial.session import NotTried, Result, Session, TrialError, quietly

SPEED = 1.0  # m/s
RUN_UP = 5.0  # s; the slowest recorded rover needs 4 s
REACHED = 0.8  # of the speed
RUNS = 3  # of each way
BRAKES = 6.0  # s to stop
READY_TRIES = 25  # of arming, each 2.4 s; ArduPilot can be armed 41 s after power-on
RATE = 25.0  # Hz, of position and attitude
HEARD_WITHIN = 20.0  # s
FARTHEST = 40.0  # m, the room that the row asks for
FORWARD = 1700  # µs
WATCHED = 12.0  # s
LONG = 8.0  # m, of a move that lasts longer than the push


async def measure(session: Session) -> float | None:
    """Measure zeros and HOLD without the server; return the better way's median, m, or None."""
    distances: dict[str, list[float]] = {"zeros": [], "HOLD": []}
    with closing(Observer(session.ground.rover())) as observer:
        driver = Driver(observer, farthest=FARTHEST, keeps_course=True)
        if not await observer.found(HEARD_WITHIN):
            raise TrialError(f"no heartbeat of a rover within {HEARD_WITHIN:g} s")
        try:
            for _ in range(RUNS):
                for way, found in distances.items():
                    metres = await _stop_by(way, driver, session)
                    found += [] if metres is None else [metres]
        except Interference as error:
            session.say(f"  not measured: {error}")
        finally:
            await driver.rest()
    for way, values in distances.items():
        session.say(f"  {way}: {', '.join(f'{value:.2f}' for value in values)} m")
    return min((median(values) for values in distances.values() if values), default=None)


async def _stop_by(way: str, driver: Driver, session: Session) -> float | None:
    """Return the stopping distance from SPEED, m; None if that is not reached."""
    track = driver.told if session.ground.truth is None else session.ground.truth
    fast = (mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED, mav.MAVLINK_MSG_ID_ATTITUDE)
    await driver.ask_rates(RATE, *fast)
    if not await driver.get_ready(READY_TRIES):
        return None
    await driver.stream(SPEED, RUN_UP)
    if track.speed() < SPEED * REACHED:
        return None
    begun = track.last.time
    if way == "HOLD":
        await driver.hold()
        await asyncio.sleep(BRAKES)
    else:
        await driver.zeros(BRAKES)
    return track.travelled(begun)  # on zeros a PX4 car drives a loop


async def stop(session: Session) -> Result:
    """Drive at 1 m/s and send STOP."""
    if session.best is None:
        raise NotTried("the shortest stopping distance is not known (--stop-distance)")
    metres: list[float] = []
    words = ""
    for _ in range(RUNS):
        try:
            task = await session.submit(Drive(SPEED, 0.0, 3 * RUN_UP))
            await session.running_since(task, 0.1)
            await asyncio.sleep(RUN_UP)
            begun = session.track.last.time
            await session.client.stop()
            await asyncio.sleep(BRAKES)
            await session.rest()
            metres.append(session.track.travelled(begun))
        except Refused as refused:
            words = str(refused)
        await session.clean()
    allowed, middle = session.limits.stop, median(metres) if metres else 0.0
    holds = len(metres) == RUNS and middle <= allowed * session.best
    shown = ", ".join(f"{value:.2f}" for value in metres)
    figure = f"{shown} m beside {session.best:.2f} m = {middle / session.best:.2f}"
    return Result(words or f"stopped {len(metres)} times", holds, figure, f"{allowed:g} x")


async def stick(session: Session, *, when: str) -> Result:
    """Push the throttle stick as a person would, when a task is starting, driving or cancelled."""
    if session.rover is not None and session.rover.kind == "px4":
        raise NotTried("PX4 does not add the stick")
    if not session.ground.can_push_stick:
        raise NotTried("no second link (--stick)")
    await session.rest()
    pushed = session.now
    try:
        if when == "starting":
            session.ground.push_stick(FORWARD)
            await quietly(lambda: session.submit(Move(LONG)))
        else:
            task = await session.submit(Move(LONG))
            await session.running_since(task, 1.0)
            if when == "cancelled":
                await task.cancel()
                await asyncio.sleep(0.1)
            pushed = session.now
            session.ground.push_stick(FORWARD)
        await asyncio.sleep(WATCHED)
        seconds, metres = session.track.stood_after(pushed), session.track.travelled(pushed)
    finally:
        session.ground.push_stick(None)
    await session.clean()
    most = session.limits.stick
    if seconds is None:
        return Result("still moves", False, f"{metres:.2f} m", f"{most:g} s")
    figure = f"after {seconds:.2f} s, {metres:.2f} m"
    return Result("stands", seconds <= most, figure, f"{most:g} s")
