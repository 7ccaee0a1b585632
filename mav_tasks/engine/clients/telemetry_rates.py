"""The message intervals to request from each vehicle: what its clients want and its link carries.

Computed each second from the present clients only: the requests of a client end when it is gone,
or so silent that it gets no telemetry any more.
"""

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.gcs_side import GcsSide
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.services.rate_budget import granted


class TelemetryRates:
    """The requester of clients' message intervals from the vehicles."""

    def __init__(self, gcs: GcsSide, vehicles: VehicleSide) -> None:
        self._gcs = gcs
        self._vehicles = vehicles
        self._had_wishes = False

    def update(self, *, now: float) -> None:
        """Pass the intervals that clients want now to each vehicle's requester."""
        clients: list[GcsClient] = []
        for client in self._gcs.clients:
            if client.is_heard and client.thinner.asked:
                clients.append(client)  # noqa: PERF401  # each second: a comprehension costs more
        if not clients and not self._had_wishes:
            return
        self._had_wishes = bool(clients)
        for vehicle in self._vehicles.all:
            wishes: dict[bool, dict[int, float]] = {True: {}, False: {}}
            for commands, least in wishes.items():
                for client in clients:
                    wished = client.thinner.wishes(vehicle.system_id, commands=commands)
                    for number, interval in wished.items():
                        least[number] = min(interval, least.get(number, interval))
            spare = self._vehicles.link_budget(vehicle, now=now).spare
            vehicle.requests.intervals.set_wishes(granted(wishes[True], wishes[False], spare=spare))
