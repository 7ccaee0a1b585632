"""The STOPs sent from here, and the outcome of each: acknowledged, then standing."""

import asyncio
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from mav_tasks.basics.errors import MavTasksError, NoAnswer, Refused
from mav_tasks.client.aio import Client
from mav_tasks.client.values import TaskStatus
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.web.flights import Flights
from mav_tasks.web.users import Line

KEPT = 50
STANDS = 0.1  # m/s; below this a rover counts as standing: measured speeds are noisy
STANDS_WITHIN = 30.0  # s
TASKS_WITHIN = 5.0  # s
CLOCKS = 0.01  # s by which a time of the server may be early, rounded as it is
COPIES = 0.02  # s between copies of STOPs that share an answer
FRESH = 1.5  # s; an older position says nothing about now


#: which rover, None: all; whether the waiting tasks are cancelled; and the connection's name
Kind = tuple[int | None, bool, str]


class Stop:
    """One STOP: of one rover, or of all (``vehicle`` None)."""

    def __init__(self, number: int, vehicle: int | None, by: str) -> None:
        self.number, self.vehicle, self.by = number, vehicle, by
        self.at = time.time()
        self.begun = time.monotonic()
        self.phase = "sent"
        self.acknowledged_after: float | None = None
        self.standing_after: float | None = None
        self.detail: str | None = None
        self.tasks: list[int] = []

    def form(self) -> dict[str, Any]:
        """Return the STOP as JSON."""
        return {
            "number": self.number,
            "at": round(self.at, 3),
            "vehicle": self.vehicle,
            "by": self.by,
            "phase": self.phase,
            "acknowledged_after": _rounded(self.acknowledged_after),
            "standing_after": _rounded(self.standing_after),
            "detail": self.detail,
            "tasks": self.tasks,
        }


class Stops:
    """Sends STOPs and follows them. ``publish`` gets a STOP at each change."""

    def __init__(self, client: Client, publish: Callable[[Stop], None]) -> None:
        self._client = client
        self._publish = publish
        self._kept: deque[Stop] = deque(maxlen=KEPT)
        self._open: set[Stop] = set()
        self._flights = Flights()
        #: STOPs that share the answer of a waiting one, by what and who
        self._sharing: dict[tuple[Kind, str], tuple[object, Stop]] = {}
        self._copied_at: dict[Kind, float] = {}
        self._copies: set[Kind] = set()
        self._following: set[asyncio.Task[None]] = set()
        self._count = 0
        #: called with the outcome of each STOP, and after how long it was acknowledged
        self.on_outcome: Callable[[str, float | None], None] = lambda _outcome, _after: None

    def forms(self) -> list[dict[str, Any]]:
        """Return the latest STOPs, the oldest first."""
        return [stop.form() for stop in self._kept]

    async def stop(self, vehicle: int | None, *, clear: bool, by: str, line: Line) -> Stop:
        """Send a STOP. Return it once it is acknowledged; raise NoAnswer or Refused.

        If the user repeats it while it is queued, both share one Stop.
        """
        kind = vehicle, clear, line.name
        shared = self._flights.waiting(kind)
        if shared is not None:
            self._copy(kind, line.client)
        whose, stop = self._sharing.get((kind, by), (None, None))
        if stop is None or shared is None or whose is not shared:
            stop = self._begun(vehicle, by)

        async def send() -> None:
            self._sharing[kind, by] = self._flights.waiting(kind), stop
            await line.client.stop(clear=clear, vehicle=vehicle)

        if shared is not None:
            self._sharing[kind, by] = shared, stop
        try:
            await self._flights.join(kind, send)
        except (NoAnswer, Refused) as error:
            self._failed(stop, error)
            raise
        finally:
            if self._sharing.get((kind, by), (None, None))[1] is stop:
                del self._sharing[kind, by]
        self._acknowledged(stop)
        return stop

    def _begun(self, vehicle: int | None, by: str) -> Stop:
        self._count += 1
        stop = Stop(self._count, vehicle, by)
        self._kept.append(stop)
        self._open.add(stop)
        # the packet leaves in this step of the loop, the event in the next one
        asyncio.get_running_loop().call_soon(self._publish, stop)
        return stop

    def _copy(self, kind: Kind, client: Client) -> None:
        """Send a copy of a STOP that shares an answer at once, or within COPIES seconds."""
        if kind in self._copies:
            return
        loop = asyncio.get_running_loop()
        wait = self._copied_at.get(kind, 0.0) + COPIES - loop.time()
        if wait > 0:
            self._copies.add(kind)
            loop.call_later(wait, self._send_copy, kind, client)
        else:
            self._send_copy(kind, client)

    def _send_copy(self, kind: Kind, client: Client) -> None:
        self._copies.discard(kind)
        self._copied_at[kind] = asyncio.get_running_loop().time()
        with suppress(MavTasksError):  # the client was closed
            client.stop_again(clear=kind[1], vehicle=kind[0])

    def _failed(self, stop: Stop, error: NoAnswer | Refused) -> None:
        if stop.phase == "sent":
            stop.phase = "refused" if isinstance(error, Refused) else "unanswered"
            stop.detail = str(error)
            self._open.discard(stop)
            self._publish(stop)
            self.on_outcome(stop.phase, None)

    def _acknowledged(self, stop: Stop) -> None:
        if stop.phase != "sent":
            return
        stop.acknowledged_after = time.monotonic() - stop.begun
        stop.phase = "acknowledged"
        self._publish(stop)
        self.on_outcome(stop.phase, stop.acknowledged_after)
        following = asyncio.create_task(self._follow(stop))
        self._following.add(following)
        following.add_done_callback(self._following.discard)

    def on_task(self, status: TaskStatus) -> None:
        """Add a task to the latest STOP that can have ended it."""
        if status.state is not TaskState.KILLED or status.reason is not TaskReason.STOP:
            return
        # its end is reported once it is durable, perhaps after the rover stands; and when asked for
        ended_at = time.monotonic() - (status.ended_ago or 0.0)
        for stop in reversed(self._kept):
            is_in_time = stop.begun < ended_at + CLOCKS < stop.begun + TASKS_WITHIN
            if is_in_time and stop.vehicle in (None, status.vehicle):
                if status.id not in stop.tasks:
                    stop.tasks.append(status.id)
                    self._publish(stop)
                return

    def on_vehicles(self) -> None:
        """Check whether the rovers of open STOPs stand now."""
        for stop in [each for each in self._open if each.phase == "acknowledged"]:
            if self._stand(stop.vehicle, since=stop.begun):
                stop.standing_after = time.monotonic() - stop.begun
                stop.phase = "standing"
                self._open.discard(stop)
                self._publish(stop)

    async def _follow(self, stop: Stop) -> None:
        await asyncio.sleep(STANDS_WITHIN)
        if stop in self._open:
            self._open.discard(stop)
            stop.detail = f"no rover data showed it standing within {STANDS_WITHIN:g} s"
            self._publish(stop)

    def _stand(self, vehicle: int | None, *, since: float) -> bool:
        """Return whether every rover that is heard has shown itself standing since then."""
        rovers = [
            each
            for each in self._client.vehicles()
            if vehicle in (None, each.id) and each.is_heard and each.speed is not None
        ]
        past = time.monotonic() - since
        return bool(rovers) and all(
            each.speed is not None
            and each.speed < STANDS
            and each.position_age is not None
            and each.position_age < min(past, FRESH)
            for each in rovers
        )


def _rounded(seconds: float | None) -> float | None:
    return None if seconds is None else round(seconds, 4)
