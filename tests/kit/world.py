"""The virtual world of the scenarios: server, rovers and clients on one net, always observed."""

from collections.abc import Callable
from typing import TypeVar

from mav_tasks.in_memory import VEHICLE_LINK, InMemoryServer
from mav_tasks.links.memory import Conditions, MemoryLink, MemoryNet
from mav_tasks.settings import Settings
from mav_tasks.store import MemoryStore, Store
from mav_tasks.tasks.lifecycle import TERMINAL
from mav_tasks.tasks.task import Task, TaskId
from rover_sim.body import Body, Pose
from rover_sim.kinematic import KinematicBody
from rover_sim.vehicle import Vehicle, make_vehicle
from rover_sim.virtual import RoverParty, VirtualWorld
from tests.kit.client import FakeClient
from tests.kit.observer import Observer

E = TypeVar("E")


def kinematic_body(start: Pose) -> Body:
    """Give the body that scenarios drive: it slips a little, as a skid-steered one does."""
    return KinematicBody(start=start, slip=0.1, seed=None)


class World(VirtualWorld):
    """One server, one rover (or more) and one client (or more)."""

    def __init__(
        self,
        *,
        seed: int = 0,
        conditions: Conditions | None = None,
        settings: Settings | None = None,
        store: Store | None = None,
        rovers: int = 1,
        body: Callable[[Pose], Body] = kinematic_body,
    ) -> None:
        self.seed = seed
        super().__init__(ObservedNet(seed=seed, conditions=conditions or Conditions()))
        self.rovers: list[Vehicle] = []
        self.observers: list[Observer] = []
        for number in range(1, rovers + 1):
            start = Pose(east=3.0 * (number - 1))
            vehicle = make_vehicle(body(start), system_id=number, now=0.0)
            link = self.net.link(f"rover{number}")
            observer = Observer()
            assert isinstance(self.net, ObservedNet)
            self.net.observers[link.name] = observer
            self.rovers.append(vehicle)
            self.observers.append(observer)
            self.join(RoverParty(vehicle, link))
        names = tuple(f"rover{number}" for number in range(1, rovers + 1))
        self.server = InMemoryServer(self.net, vehicles=names, settings=settings, store=store)
        self.join(self.server)
        self.client = self.add_client("client")

    @property
    def rover(self) -> Vehicle:
        """The first rover."""
        return self.rovers[0]

    @property
    def observer(self) -> Observer:
        """The observer of the first rover."""
        return self.observers[0]

    def add_client(self, name: str, *, system_id: int = 255, component_id: int = 190) -> FakeClient:
        """Let another client take part."""
        client = FakeClient(self.net, name, system_id=system_id, component_id=component_id)
        self.join(client)
        return client

    def ready(self) -> "World":
        """Wait until the server has found every rover and knows where it is."""
        assert self.run_until(self._is_ready, within=30), "the server did not find its rovers"
        return self

    def task(self, task_id: int) -> Task:
        """Give a task as the server has it now."""
        tasks = {task.id: task for task in self.tasks()}
        return tasks[TaskId(task_id)]

    def tasks(self) -> tuple[Task, ...]:
        """Give every task of the server."""
        return self.server.engine.snapshot(now=self.now).tasks

    def is_idle(self, *, tasks: int) -> bool:
        """Whether so many tasks were submitted, all are over, and the rover is handed back."""
        snapshot = self.server.engine.snapshot(now=self.now)
        return (
            len(snapshot.tasks) == tasks
            and all(task.state in TERMINAL for task in snapshot.tasks)
            and all(vehicle.control == "IDLE" for vehicle in snapshot.vehicles)
        )

    def events(self, kind: type[E]) -> list[E]:
        """Give the journal's events of one kind, in order."""
        store = self.server.store
        assert isinstance(store, MemoryStore)
        return [event for event in store.events if isinstance(event, kind)]

    def check(self) -> None:
        """Raise what any observer saw that must never be. Call it at the end of every scenario."""
        for observer in self.observers:
            observer.check()

    def _is_ready(self) -> bool:
        snapshot = self.server.engine.snapshot(now=self.now)
        return (
            len(snapshot.vehicles) == len(self.rovers)
            and all(client.of_type("LOCAL_POSITION_NED") for client in [self.client])
            and self.now > 3.0
        )


class ObservedNet(MemoryNet):
    """A net that shows to observers what arrives at rovers, and what arrives from them."""

    def __init__(self, *, seed: int, conditions: Conditions) -> None:
        super().__init__(seed=seed, conditions=conditions)
        self.observers: dict[str, Observer] = {}

    def arrive(self, link: MemoryLink, source: str, data: bytes) -> None:
        """Show it, then deliver it."""
        if link.name in self.observers:
            self.observers[link.name].to_rover(self.now, data)
        elif link.name == VEHICLE_LINK and source in self.observers:
            self.observers[source].to_server(self.now, data)
        super().arrive(link, source, data)
