"""The metrics of the web process: what it sees of the rovers, and how it serves browsers.

``serve --metrics`` has the task server's own metrics (setpoints, store, links). A metric with the
same meaning has the same name there.
"""

from collections import Counter
from collections.abc import Iterator
from itertools import chain
from math import inf

from mav_tasks.basics.histogram import Histogram
from mav_tasks.metrics import families as f
from mav_tasks.metrics import process
from mav_tasks.metrics.exposition import PREFIX, Family, Sample, lines_of
from mav_tasks.web.live import Live

BATTERY = Family(
    f"{PREFIX}vehicle_battery_ratio", "gauge", "Charge that is left, 0 to 1.", ("vehicle",)
)
REACHABLE = Family(f"{PREFIX}web_server_reachable", "gauge", "1 if the task server is heard.")
STREAMS = Family(f"{PREFIX}web_event_streams", "gauge", "Open event streams of browsers.")
REQUESTS = Family(f"{PREFIX}web_requests_total", "counter", "Answers to requests.", ("code",))
STOPS = Family(f"{PREFIX}web_stops_total", "counter", "STOPs sent from here.", ("outcome",))
ACKNOWLEDGED = Family(
    f"{PREFIX}web_stop_acknowledged_seconds",
    "histogram",
    "Time from a STOP's request until the task server acknowledged it.",
)
BOUNDS = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)

FAMILIES = (
    *(f.TASKS, f.QUEUE_LENGTH, f.QUEUE_CAPACITY, f.QUEUE_PAUSED),
    *(f.HEARTBEAT_AGE, f.POSITION_AGE, BATTERY),
    *(REACHABLE, STREAMS, REQUESTS, STOPS, ACKNOWLEDGED),
)


class Figures:
    """The figures of one web process."""

    def __init__(self, live: Live) -> None:
        self._live = live
        self._answers: Counter[int] = Counter()
        self._stops: Counter[str] = Counter()
        self._acknowledged = Histogram(BOUNDS)
        live.stops.on_outcome = self._on_stop

    def __repr__(self) -> str:
        return f"Figures({dict(self._answers)})"

    def note_answer(self, status: int) -> None:
        """Count an answer by its status."""
        self._answers[status] += 1

    def text(self) -> str:
        """Return all metrics in Prometheus' text format."""
        parts = [(family, self._samples(family)) for family in FAMILIES]
        lines = chain.from_iterable(lines_of(*part) for part in chain(parts, process.figures()))
        return "".join(f"{line}\n" for line in lines)

    def _on_stop(self, outcome: str, acknowledged_after: float | None) -> None:
        self._stops[outcome] += 1
        if acknowledged_after is not None:
            self._acknowledged.note(acknowledged_after)

    def _samples(self, family: Family) -> Iterator[Sample]:
        live = self._live
        queues, rovers = live.queues.values(), live.client.vehicles()
        if family is f.TASKS:
            yield from self._tasks()
        elif family is f.QUEUE_LENGTH:
            yield from (((str(each.vehicle),), each.waiting_count) for each in queues)
        elif family is f.QUEUE_CAPACITY:
            yield from (((str(each.vehicle),), each.capacity) for each in queues)
        elif family is f.QUEUE_PAUSED:
            for queue in queues:
                reason = "" if queue.paused is None else queue.paused.name.lower()
                yield (str(queue.vehicle), reason), float(queue.paused is not None)
        elif family is f.HEARTBEAT_AGE:
            yield from (((str(each.id),), _age(each.heartbeat_age)) for each in rovers)
        elif family is f.POSITION_AGE:
            yield from (((str(each.id),), _age(each.position_age)) for each in rovers)
        elif family is BATTERY:
            known = ((each.id, each.battery) for each in rovers)
            yield from (((str(rover),), left) for rover, left in known if left is not None)
        elif family is REACHABLE:
            yield (), float(live.is_reachable)
        elif family is STREAMS:
            yield (), live.hub.readers
        elif family is REQUESTS:
            yield from (((str(code),), count) for code, count in sorted(self._answers.items()))
        elif family is STOPS:
            yield from (((outcome,), count) for outcome, count in sorted(self._stops.items()))
        else:  # ACKNOWLEDGED
            yield (), self._acknowledged.figures()

    def _tasks(self) -> Iterator[Sample]:
        """Yield tasks by state and reason; of long queues only the listed ones have a reason."""
        for queue in self._live.queues.values():
            listed = [*queue.waiting, *([] if queue.current is None else [queue.current])]
            counts = Counter(
                (task.state.name.lower(), task.reason.name.lower() if task.reason else "none")
                for task in listed
            )
            for (state, reason), count in sorted(counts.items()):
                yield (str(queue.vehicle), state, reason), count


def _age(seconds: float | None) -> float:
    return inf if seconds is None else seconds
