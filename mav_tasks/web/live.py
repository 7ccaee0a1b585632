"""One live view of the task server for all browsers: rovers, queues, texts, tracks, STOPs.

The task server reports each change of a task. The view requests a queue after such a change, and
every two seconds, because a pause is not reported. It is one client on one link for any number of
browsers.
"""

import asyncio
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from mav_tasks.basics.errors import ClientError
from mav_tasks.basics.latest import shorten
from mav_tasks.client.aio import Client
from mav_tasks.client.descriptions import what_of
from mav_tasks.client.values import News, QueueStatus, TaskStatus, Text, VehicleChanged
from mav_tasks.web.forms import queue_form, task_form, text_form, vehicle_form
from mav_tasks.web.goal_places import Place, places_of_words
from mav_tasks.web.hub import Hub
from mav_tasks.web.origins import Origins
from mav_tasks.web.queue_rows import QueueRows
from mav_tasks.web.stops import Stop, Stops
from mav_tasks.web.tracks import Tracks

FRAME = 0.05  # s in which changes of rovers are collected
WHOLE = 1.0  # s between looks at all rovers: a rover that falls silent sends nothing
PERIOD = 2.0  # s between requests for a queue that nothing has changed
GAP = 0.2  # s, least time between two requests for a queue
LISTED = 200  # waiting tasks of a queue that the page gets
TEXTS = 2000
TEXTS_AT_FIRST = 200
PROGRESS = 0.5  # s between statuses of a running task
UNREACHED = 3.0  # s without a packet
PREARM = "prearm"
PREARM_LASTS = 35.0  # s; an autopilot repeats what is wrong every 30 s
PLAN = "plan of "  # the description of a mission
PLACES = 100_000  # of all tasks together, that are remembered
LOOKED_UP = 5000  # tasks
FEW = 100  # places of a task that queues and events show; the task itself shows more
MOST_TOLD = 20_000


class Live:
    """The view. ``run`` keeps it until it is cancelled."""

    def __init__(self, client: Client, instance: str, *, server: str) -> None:
        self.client = client
        self.hub = Hub(instance, snapshot=self.snapshot, vehicles=self._all_vehicles)
        self.tracks = Tracks()
        self.stops = Stops(client, self._publish_stop)
        self.queues: dict[int, QueueStatus] = {}
        self.places: dict[int, list[Place]] = {}
        self.users: dict[int, str] = {}  # who submitted tasks, as far as that is known
        self._places_count = 0
        self._rows = QueueRows()
        self._server = server
        self._origins = Origins()
        self._texts: deque[dict[str, Any]] = deque(maxlen=TEXTS)
        self._text_count = 0
        self._prearm: dict[int, dict[str, float]] = {}
        #: looks up the places of a task that another client submitted
        self.on_unknown_places: Callable[[int], None] = lambda _task: None
        self._looked_up: dict[int, None] = {}
        self._told: dict[int, object] = {}  # what the page knows of tasks
        self._running: dict[int, TaskStatus] = {}
        self._dirty: dict[int, asyncio.Event] = {}
        self._changed: set[int] = set()
        self._flush: asyncio.TimerHandle | None = None
        self._since = 0.0  # when the first change since the last flush came
        self._heard_at = -UNREACHED
        self.is_reachable = False

    def __repr__(self) -> str:
        return f"Live({self._server}, {len(self.queues)} queues, {self.hub!r})"

    # requests

    def snapshot(self) -> dict[str, Any]:
        """Return the data of the page's first event."""
        return {
            "now": round(time.time(), 3),
            "reachable": self.is_reachable,
            "detail": self.why_not_ready(),
            "vehicles": self.vehicle_forms(),
            "queues": self._rows.forms(),
            "texts": list(self._texts)[-TEXTS_AT_FIRST:],
            "stops": self.stops.forms(),
        }

    def vehicle_forms(self, only: set[int] | None = None) -> list[dict[str, Any]]:
        """Return rovers as JSON; ``only``: these."""
        return [
            vehicle_form(
                each,
                self.queues.get(each.id),
                prearm=self._prearm_of(each.id),
                goal=self._goal_of(each.id),
                origin=self._origins.of(each),
            )
            for each in (
                self.client.vehicles() if only is None else self.client.some_vehicles(only)
            )
        ]

    def queue_form(self, queue: QueueStatus) -> dict[str, Any]:
        """Return a queue as JSON, with the places of its tasks if they are few."""
        tasks = [*queue.waiting, *([] if queue.current is None else [queue.current])]
        return queue_form(queue, goals={each.id: self._few_places_of(each) for each in tasks})

    def task_form(self, status: TaskStatus, *, is_whole: bool = False) -> dict[str, Any]:
        """Return a task as JSON, with its places if they are few, or it is to be whole."""
        places = self.places_of(status) if is_whole else self._few_places_of(status)
        user = self.users.get(status.id, "")
        return task_form(status, goals={status.id: places}, user=user)

    def _few_places_of(self, status: TaskStatus) -> list[Place] | None:
        """Return the places of a task; [] if they are many."""
        places = self.places_of(status)
        return places if places is None or len(places) <= FEW else []

    def places_of(self, status: TaskStatus) -> list[Place] | None:
        """Return the places that a task drives to; None: not known (yet)."""
        known = self.places.get(status.id)
        is_plan = what_of(status).startswith(PLAN) and not status.is_over
        if known is None and is_plan and status.id not in self._looked_up:
            self._looked_up[status.id] = None
            shorten(self._looked_up, LOOKED_UP)
            self.on_unknown_places(status.id)
        return known or places_of_words(what_of(status))

    def remember_places(self, task_id: int, places: list[Place]) -> None:
        """Keep the places of a task that was submitted here."""
        self._places_count += len(places) - len(self.places.pop(task_id, ()))
        self.places[task_id] = places
        while self._places_count > PLACES:
            self._places_count -= len(self.places.pop(next(iter(self.places))))

    def remember_user(self, task_id: int, user: str) -> None:
        """Keep who submitted a task."""
        self.users[task_id] = user
        shorten(self.users, MOST_TOLD)

    def show_again(self, task_id: int) -> None:
        """Publish the queue of a task again: its places are known now."""
        for queue in self.queues.values():
            current = () if queue.current is None else (queue.current,)
            if any(each.id == task_id for each in (*current, *queue.waiting)):
                self._publish_queue(queue)

    def texts(self, *, before: int | None, limit: int) -> list[dict[str, Any]]:
        """Return texts, the newest last."""
        found = [each for each in self._texts if before is None or each["number"] < before]
        return found[-limit:]

    def hurry(self, vehicle: int) -> None:
        """Request a rover's queue soon, after a request that may have changed it."""
        if vehicle in self._dirty:
            self._dirty[vehicle].set()

    async def refresh(self, vehicle: int) -> None:
        """Request a rover's queue now, so that the next answer shows the change."""
        with suppress(ClientError):  # the page shows how old its data are
            await self._fetch(vehicle)

    # the view

    async def run(self) -> None:
        """Keep the view up to date until cancelled. The client is open."""
        with self.client.listening(self._on_news):
            async with asyncio.TaskGroup() as group:
                known: set[int] = set()
                while True:
                    for vehicle in self.client.vehicles():
                        if vehicle.id not in known:
                            known.add(vehicle.id)
                            self._dirty[vehicle.id] = asyncio.Event()
                            group.create_task(self._keep_queue(vehicle.id))
                    self._look_at_server()
                    self._changed |= known
                    self._publish_vehicles()
                    await asyncio.sleep(WHOLE)

    async def _keep_queue(self, vehicle: int) -> None:
        dirty = self._dirty[vehicle]
        with self.client.streaming(vehicle, PROGRESS):
            while True:
                dirty.clear()
                await self.refresh(vehicle)
                await asyncio.sleep(GAP)
                with suppress(TimeoutError):
                    async with asyncio.timeout(PERIOD - GAP):
                        await dirty.wait()

    async def _fetch(self, vehicle: int) -> None:
        before = self.queues.get(vehicle)
        queue = await self.client.queue(vehicle=vehicle, limit=0)
        if before is None or _essence(before) != _essence(queue):
            queue = await self.client.queue(vehicle=vehicle, limit=LISTED)
            self.queues[vehicle] = queue
            self._publish_queue(queue)
            self._mark(vehicle)

    def _publish_queue(self, queue: QueueStatus) -> None:
        self.hub.publish("queue", self._rows.change(self.queue_form(queue)))

    # news

    def _on_news(self, news: News) -> None:
        self._heard_at = time.monotonic()
        match news:
            case VehicleChanged(vehicle=vehicle):
                self._mark(vehicle)
            case TaskStatus():
                self._on_task(news)
            case Text():
                self._on_text(news)
            case _:
                known = self.queues.get(news.vehicle)
                if known is not None and _essence(known) != _essence(news):
                    self.hurry(news.vehicle)

    def _on_task(self, status: TaskStatus) -> None:
        self.stops.on_task(status)
        before = self._running.get(status.vehicle)
        if status.is_active:
            self._running[status.vehicle] = status
        elif before is not None and before.id == status.id:
            del self._running[status.vehicle]
        queue = self.queues.get(status.vehicle)
        if queue is None or not _is_listed(status, queue):
            self.hurry(status.vehicle)
        told = (status.version, status.state, status.reason, status.progress, status.remaining)
        if self._told.get(status.id) != told:  # else the answer to a request
            self._told[status.id] = told
            shorten(self._told, MOST_TOLD)
            self.hub.publish("task", self.task_form(status))

    def _on_text(self, text: Text) -> None:
        at = time.time()
        if text.words.lower().startswith(PREARM):
            self._prearm.setdefault(text.vehicle, {})[text.words] = at
        self._text_count += 1
        form = text_form(text, number=self._text_count, at=at)
        self._texts.append(form)
        self.hub.publish("text", form)

    def _mark(self, vehicle: int) -> None:
        self._changed.add(vehicle)
        if self._flush is None:
            self._since = time.time()
            loop = asyncio.get_running_loop()
            self._flush = loop.call_later(FRAME, self._publish_vehicles)

    def _publish_vehicles(self) -> None:
        now = since = time.time()
        if self._flush is not None:
            self._flush.cancel()
            self._flush = None
            since = self._since
        changed, self._changed = self._changed, set()
        for each in self.client.some_vehicles(changed):
            running = self._running.get(each.id)
            self.tracks.add(each, task=None if running is None else running.id, at=now)
        self.stops.on_vehicles()
        if self.hub.readers:
            vehicles = self.vehicle_forms(changed)
            if vehicles:
                form = {"now": round(now, 3), "since": round(since, 3), "vehicles": vehicles}
                self.hub.publish_vehicles(form)

    def _all_vehicles(self) -> dict[str, Any]:
        now = round(time.time(), 3)
        return {"now": now, "since": now, "vehicles": self.vehicle_forms()}

    def _publish_stop(self, stop: Stop) -> None:
        self.hub.publish("stop", stop.form())

    def _look_at_server(self) -> None:
        is_reachable = time.monotonic() - self._heard_at < UNREACHED
        if is_reachable != self.is_reachable:
            self.is_reachable = is_reachable
            detail = self.why_not_ready()
            self.hub.publish("server", {"reachable": is_reachable, "detail": detail})

    def why_not_ready(self) -> str | None:
        """Return why the view is out of date; None if the task server is heard."""
        if self.is_reachable:
            return None
        return f"no answer from the task server at {self._server}: is it running?"

    def _prearm_of(self, vehicle: int) -> list[str]:
        """Return the lately reported failures of the rover's checks before arming."""
        now = time.time()
        texts = self._prearm.get(vehicle, {})
        return [words for words, at in texts.items() if now - at < PREARM_LASTS]

    def _goal_of(self, vehicle: int) -> Place | None:
        running = self._running.get(vehicle)
        if running is None:
            return None
        places = self.places_of(running) or []
        if not places:
            return None
        return places[min(max(running.item, 1), len(places)) - 1]


def _essence(queue: QueueStatus) -> object:
    """Return what counts as a change of a queue."""
    halts = (queue.paused, queue.halt_epoch)
    return queue.version, queue.running, queue.next, dict(queue.counts), halts


def _is_listed(status: TaskStatus, queue: QueueStatus) -> bool:
    """Return whether a queue shows a task in this state already."""
    shown = [*queue.waiting, *([] if queue.current is None else [queue.current])]
    return any(
        each.id == status.id and (each.state, each.reason) == (status.state, status.reason)
        for each in shown
    )
