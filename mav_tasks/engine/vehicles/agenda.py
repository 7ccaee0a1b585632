"""Which vehicles have something to do, and when, without asking every one of them each time.

A vehicle that nothing has touched has nothing new to say: what comes in costs the same whether
there are two rovers or two hundred.
"""

from heapq import heapify, heappop, heappush
from math import inf

from mav_tasks.engine.inputs import Outgoing
from mav_tasks.engine.vehicles.vehicle import Vehicle

SPARE = 64  # entries out of date in the heap, beyond which it is built anew


class Agenda:
    """The deadlines of all vehicles, and which of them have been touched since the last look."""

    def __init__(self) -> None:
        self._touched: dict[int, Vehicle] = {}
        self._due: dict[int, float] = {}
        self._heap: list[tuple[float, int]] = []
        self._awaiting: dict[int, Vehicle] = {}
        self._words: dict[int, tuple[Outgoing, ...]] = {}
        #: zero and HOLD for every vehicle that is being driven
        self.last_words: tuple[Outgoing, ...] = ()

    def __repr__(self) -> str:
        return f"Agenda({len(self._due)} vehicles, next at {self.next_deadline()})"

    def touch(self, vehicle: Vehicle) -> None:
        """Note that something is being done to a vehicle."""
        self._touched[vehicle.system_id] = vehicle

    def settle(self) -> list[Vehicle]:
        """Look at those that were touched; gives them."""
        touched = list(self._touched.values())
        self._touched.clear()
        for vehicle in touched:
            system_id = vehicle.system_id
            due = vehicle.next_deadline()
            if due != self._due.get(system_id):
                self._due[system_id] = due
                if due < inf:
                    heappush(self._heap, (due, system_id))
            if vehicle.tasks.turns.awaits_commit:
                self._awaiting[system_id] = vehicle
            else:
                self._awaiting.pop(system_id, None)
            self._note_words(vehicle)
        if len(self._heap) > 2 * len(self._due) + SPARE:
            self._heap = [(due, system_id) for system_id, due in self._due.items() if due < inf]
            heapify(self._heap)
        return touched

    def awaiting_commit(self) -> list[Vehicle]:
        """Give the vehicles whose next task waits for nothing but being durable."""
        return list(self._awaiting.values())

    def next_deadline(self) -> float:
        """Give when the first vehicle has something to do; inf: none has."""
        heap = self._heap
        while heap and self._due[heap[0][1]] != heap[0][0]:
            heappop(heap)
        return heap[0][0] if heap else inf

    def take_due(self, *, now: float) -> list[int]:
        """Give the vehicles that have something to do by now."""
        due: list[int] = []
        while self.next_deadline() <= now:
            _, system_id = heappop(self._heap)
            self._due[system_id] = inf  # until it is settled
            due.append(system_id)
        return due

    def _note_words(self, vehicle: Vehicle) -> None:
        words = vehicle.requests.last_words if vehicle.control.is_engaged else ()
        if words != self._words.get(vehicle.system_id, ()):
            self._words[vehicle.system_id] = words
            self.last_words = tuple(word for words in self._words.values() for word in words)
