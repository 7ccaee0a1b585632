"""Which vehicles have something to do, and when, without asking each vehicle each time.

Only the deadlines of changed vehicles are planned again, so that an input costs the same with two
rovers as with two hundred.
"""

from functools import partial
from math import inf

from mav_tasks.engine.inputs import Outgoing
from mav_tasks.engine.timers import Timer, Timers, Turn
from mav_tasks.engine.vehicles.vehicle import Vehicle


class DeadlineHeap:
    """The timers of all vehicles, and the vehicles that have changed since they were settled."""

    def __init__(self, timers: Timers) -> None:
        self._timers = timers
        #: vehicles that may have changed since they were settled
        self.touched: dict[int, Vehicle] = {}
        self._due: dict[int, Timer] = {}
        self._awaiting: dict[int, Vehicle] = {}
        self._words: dict[int, tuple[Outgoing, ...]] = {}
        #: zero and HOLD for every vehicle that is being driven
        self.emergency_stop_packets: tuple[Outgoing, ...] = ()

    def __repr__(self) -> str:
        return f"DeadlineHeap({len(self._due)} vehicles, next at {self.next_deadline()})"

    def mark_dirty(self, vehicle: Vehicle) -> None:
        """Note that a vehicle may be changing."""
        self.touched[vehicle.system_id] = vehicle

    def forget(self, system_id: int) -> None:
        """Forget a vehicle, which this gateway does not have any more."""
        self.touched.pop(system_id, None)
        self._awaiting.pop(system_id, None)
        if (timer := self._due.pop(system_id, None)) is not None:
            self._timers.forget(timer)
        if self._words.pop(system_id, ()):
            self._join_words()

    def plan(self) -> None:
        """Set the timers of the changed vehicles."""
        for system_id, vehicle in self.touched.items():
            timer = self._due.get(system_id)
            if timer is None:
                do = partial(self._handle_deadline, vehicle)
                timer = self._timers.timer(Turn.VEHICLES, do, number=system_id)
                self._due[system_id] = timer
            timer.set(vehicle.next_deadline())

    def settle(self) -> list[Vehicle]:
        """Plan the changed vehicles, update what is kept of them, and return them."""
        self.plan()
        touched = list(self.touched.values())
        self.touched.clear()
        for vehicle in touched:
            system_id = vehicle.system_id
            if vehicle.tasks.awaits_commit:
                self._awaiting[system_id] = vehicle
            else:
                self._awaiting.pop(system_id, None)
            self._note_words(vehicle)
        return touched

    def awaiting_commit(self) -> list[Vehicle]:
        """Return the vehicles whose next task waits only for its events to be durable."""
        return list(self._awaiting.values())

    def next_deadline(self) -> float:
        """Return when the first vehicle has something to do, or inf."""
        return min((timer.at for timer in self._due.values()), default=inf)

    def _handle_deadline(self, vehicle: Vehicle, *, now: float) -> None:
        self.touched[vehicle.system_id] = vehicle
        vehicle.handle_deadline(now=now)

    def _note_words(self, vehicle: Vehicle) -> None:
        words = vehicle.requests.emergency_stop_packets if vehicle.control.is_engaged else ()
        if words != self._words.get(vehicle.system_id, ()):
            self._words[vehicle.system_id] = words
            self._join_words()

    def _join_words(self) -> None:
        self.emergency_stop_packets = tuple(
            word for words in self._words.values() for word in words
        )
