"""Figures of the running engine, for metrics: small immutable values, read from the parts.

Reading changes nothing. A vehicle's figures cost the same however many tasks it has.
"""

from dataclasses import dataclass
from math import inf

from mav_tasks.basics.histogram import Distribution
from mav_tasks.engine.clients.gcs_side import GcsSide
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.tasks.fleet import Fleet
from mav_tasks.tasks.forecast import tally
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.registry import TaskRegistry


@dataclass(frozen=True, slots=True)
class VehicleFigures:
    """Figures of one vehicle. Ages in s, inf if nothing came in this run.

    ``waiting``: tasks that have not started, at most ``capacity``. ``tasks``: unfinished tasks by
    state and reason. ``intervals``: between setpoints of running tasks, every ``period`` s.
    """

    vehicle: int
    heartbeat_age: float
    position_age: float
    waiting: int
    capacity: int
    paused: TaskReason
    tasks: tuple[tuple[TaskState, TaskReason, int], ...]
    intervals: Distribution
    period: float


@dataclass(frozen=True, slots=True)
class EngineFigures:
    """Figures of the whole engine. ``vehicles`` are the system ids with figures of their own.

    ``corrupt`` counts packets by the side that they came from.
    """

    vehicles: tuple[int, ...]
    clients: int
    corrupt: tuple[tuple[str, int], ...]
    flooded: int  # datagrams dropped by the limit of each client's rate


class Figures:
    """Reads the figures of an engine's parts."""

    def __init__(
        self,
        vehicles: VehicleSide,
        gcs: GcsSide,
        fleet: Fleet,
        registry: TaskRegistry,
    ) -> None:
        self._vehicles = vehicles
        self._gcs = gcs
        self._fleet = fleet
        self._registry = registry

    def __repr__(self) -> str:
        return f"Figures({self._registry!r})"

    def all(self) -> EngineFigures:
        """Return the figures that belong to no single vehicle."""
        sides = (("vehicles", self._vehicles.counts), ("clients", self._gcs.counts))
        return EngineFigures(
            vehicles=tuple(sorted(tasks.vehicle for tasks in self._fleet)),
            clients=len(self._gcs.clients),
            corrupt=tuple((side, counts.corrupt) for side, counts in sides),
            flooded=self._gcs.left_out,
        )

    def of(self, system_id: int, *, now: float) -> VehicleFigures | None:
        """Return the figures of a vehicle that ``all`` named, None if it has gone since."""
        tasks, vehicle = self._fleet.get(system_id), self._vehicles.look_at(system_id)
        if tasks is None:
            return None
        motion = None if vehicle is None else vehicle.where.latest()
        return VehicleFigures(
            vehicle=system_id,
            heartbeat_age=inf if vehicle is None else max(0.0, now - vehicle.heard_at),
            position_age=inf if motion is None else max(0.0, now - motion.at),
            waiting=tasks.room.count(system_id),
            capacity=tasks.settings.queueing.capacity,
            paused=tasks.paused,
            tasks=tuple(
                (state, reason, count)
                for (state, reason), count in tally(tasks, self._registry.counts[system_id]).items()
            ),
            intervals=tasks.executor.intervals.figures(),
            period=tasks.settings.watch.setpoint_period,
        )

    def is_still(self, system_id: int, *, now: float) -> bool:
        """Return whether fresh data shows that a vehicle stands."""
        vehicle = self._vehicles.look_at(system_id)
        return vehicle is not None and vehicle.where.is_still(now=now)
