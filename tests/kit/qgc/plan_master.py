"""The plan view: mission, fence and rally points, transferred one after another."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from tests.kit.qgc.core import Core
from tests.kit.qgc.plans import FENCE, MISSION, RALLY, Item, PlanManager
from tests.kit.qgc.vehicle import APM, VehicleState
from tests.kit.qgc.wire import Message

HAS_FENCE, HAS_RALLY = 0x4000, 0x8000  # MAV_PROTOCOL_CAPABILITY
RUNS = "Current mission must be paused prior to uploading a new Plan"
WAYPOINT, GLOBAL, RELATIVE, NO_FRAME = 16, 0, 3, 2
VERTEX_INSIDE, RALLY_POINT = 5001, 5100

Places = Sequence[tuple[int, int]]  # degE7


class Plan(NamedTuple):
    """A plan as the person drew it."""

    home: tuple[int, int]
    waypoints: Places
    fence: Places = ()  # a polygon to stay in
    rally: Places = ()
    speed: float | None = None  # m/s, from the start

    def mission(self, firmware: str) -> list[Item]:
        """Return the items; only ArduPilot's begin with home [3.4], [11.3], [11.8]."""
        items = [Item(WAYPOINT, x, y) for x, y in self.waypoints]
        if self.speed is not None:  # [3.6]: airspeed, even for a rover
            items.insert(0, Item(178, 0, 0, 0.0, NO_FRAME, 0.0, self.speed, -1.0, 0.0))
        if firmware == APM:
            items.insert(0, Item(WAYPOINT, *self.home, 0.0, GLOBAL, param4=0.0))
        items[0] = items[0]._replace(current=1)
        return items

    def fence_items(self) -> list[Item]:
        """Return the corners [3.6]."""
        count = float(len(self.fence))
        return [Item(VERTEX_INSIDE, x, y, 0.0, GLOBAL, count, param4=0.0) for x, y in self.fence]

    def rally_items(self) -> list[Item]:
        """Return the rally points."""
        return [Item(RALLY_POINT, x, y, 0.0, RELATIVE, param4=0.0) for x, y in self.rally]


class PlanMaster:
    """Upload, download and removal of all plan types that the vehicle supports."""

    def __init__(self, core: Core, vehicle: VehicleState) -> None:
        self._core = core
        self._vehicle = vehicle
        self.capabilities = 0
        self.managers = {
            kind: PlanManager(core, kind, vehicle.firmware) for kind in (MISSION, FENCE, RALLY)
        }
        #: success of the last upload, download or removal, by type
        self.outcome: dict[int, bool] = {}
        self.is_done = True

    @property
    def kinds(self) -> list[int]:
        """The plan types that the vehicle's capabilities include [1.3]."""
        bits = {FENCE: HAS_FENCE, RALLY: HAS_RALLY}
        return [kind for kind in self.managers if self.capabilities & bits.get(kind, ~0)] or [0]

    @property
    def has_mission(self) -> bool:
        """Whether the station knows of items on the vehicle."""
        return bool(self.managers[MISSION].known)

    def upload(self, plan: Plan) -> None:
        """Send all three, even empty ones, and even after a refusal [3.1], [11.8]."""
        if self._vehicle.armed and self._vehicle.is_in_mission_mode:  # [3.5]
            self._core.popup(RUNS)
            return
        items = {
            MISSION: plan.mission(self._vehicle.firmware),
            FENCE: plan.fence_items(),
            RALLY: plan.rally_items(),
        }
        self._each(lambda kind, done: self.managers[kind].write(items[kind], done))

    def download(self, then: Callable[[], None] = lambda: None) -> None:
        """Read all three, one after another."""
        self._each(lambda kind, done: self.managers[kind].read(done), then)

    def remove(self) -> None:
        """Send three messages, not one for all types [11.8]."""
        self._each(lambda kind, done: self.managers[kind].clear(done))

    def receive(self, name: str, message: Message) -> None:
        """Take a message of the mission protocol."""
        for manager in self.managers.values():
            manager.receive(name, message)

    def _each(
        self,
        begin: Callable[[int, Callable[[bool], None]], None],
        then: Callable[[], None] = lambda: None,
    ) -> None:
        assert self.is_done, "the plan view is busy"
        self.is_done = False
        self.outcome = {}
        waiting = self.kinds

        def go_on() -> None:
            if not waiting:
                self.is_done = True
                then()
                return
            kind = waiting.pop(0)

            def done(success: bool) -> None:
                self.outcome[kind] = success
                go_on()

            begin(kind, done)

        go_on()
