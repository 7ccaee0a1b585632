"""What each vehicle is asked to stream: as the clients wish that are there, and its link carries.

Worked out anew each second, and nothing else is remembered: a client that is gone, or so silent
that it is shown no telemetry any more, has taken its wishes with it.
"""

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.gcs_side import GcsSide
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.services.rate_budget import granted


class TelemetryRates:
    """Brings the wishes of clients to the vehicles."""

    def __init__(self, gcs: GcsSide, vehicles: VehicleSide) -> None:
        self._gcs = gcs
        self._vehicles = vehicles
        self._had_wishes = False

    def update(self, *, now: float) -> None:
        """Have each vehicle asked for what is wished now."""
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
            spare = self._vehicles.links.link_budget(vehicle, now=now).spare
            vehicle.requests.intervals.set_wishes(granted(wishes[True], wishes[False], spare=spare))
