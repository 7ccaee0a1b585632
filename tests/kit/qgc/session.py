"""One vehicle in the station, from its first heartbeat on."""

from collections.abc import Callable

from tests.kit.qgc.commands import CommandQueue
from tests.kit.qgc.connect import Connecting
from tests.kit.qgc.core import AUTOPILOT, Core
from tests.kit.qgc.guided import Operator
from tests.kit.qgc.plan_master import PlanMaster
from tests.kit.qgc.popups import Shown, Texts
from tests.kit.qgc.requests import MessageRequests
from tests.kit.qgc.timers import Timer
from tests.kit.qgc.vehicle import PX4, VehicleState
from tests.kit.qgc.wire import Heard, Message

SILENT_AFTER = 3.5  # s [1.1]
TEXT_WAIT = 1.0  # s for the remaining chunks of a text; assumed
GIMBAL_MANAGER, GIMBAL_TRIES = 280, 6  # [1.3]
LOST, BACK = "Communication lost", "Communication regained"


class Session:
    """The station's state of one vehicle, and its parts for it."""

    def __init__(self, core: Core, heartbeat: Message, fall_back: Callable[[], None]) -> None:
        self._core = core
        self.state = VehicleState(heartbeat, now=core.timers.now)
        self.commands = CommandQueue(core)
        self._requests = MessageRequests(core, self.commands)
        self.plans = PlanMaster(core, self.state)
        self.connecting = Connecting(
            core, self.state.firmware, self.commands, self._requests, self.plans, fall_back
        )
        self.parameters = self.connecting.parameters
        self.operator = Operator(core, self.state, self.commands, self.plans)
        self._texts = Texts(core.screen, drops_tabs=self.state.firmware == PX4)
        self._gimbals_asked: dict[int, int] = {}
        self._silence: Timer | None = None
        self.is_lost = False

    def begin(self) -> None:
        """Start the requests."""
        self.connecting.begin()
        self._heard()

    def receive(self, heard: Heard) -> None:
        """Take a packet of the vehicle's system."""
        message, name, (_, component) = heard
        self._heard()
        if component == AUTOPILOT:
            self.state.receive(name, message)
        self._requests.receive(name, message, component)
        match name:
            case "HEARTBEAT":
                self._ask_for_gimbals(component)
            case "COMMAND_ACK":
                self.commands.receive(message, component)
            case "PARAM_VALUE":
                self.parameters.receive(message, component)
            case "FILE_TRANSFER_PROTOCOL":
                self.parameters.receive_file(message)
            case "STATUSTEXT":
                self._take_text(message, component)
            case (
                "MISSION_COUNT"
                | "MISSION_ITEM_INT"
                | "MISSION_REQUEST"
                | "MISSION_REQUEST_INT"
                | "MISSION_ACK"
            ):
                self.plans.receive(name, message)

    def _take_text(self, message: Message, component: int) -> None:
        timers = self._core.timers
        self._texts.receive(message, component, now=timers.now)
        if message.id:
            timers.after(
                TEXT_WAIT, lambda: self._texts.give_up(component, message.id, now=timers.now)
            )

    def _heard(self) -> None:
        now = self._core.timers.now
        self.state.heard_at = now
        if self.is_lost:  # [11.10]: it requests nothing again
            self.is_lost = False
            self._core.screen.notices.append(Shown(now, BACK))
        if self._silence is None:
            self._silence = self._core.timers.after(SILENT_AFTER, self._look_for_silence)

    def _look_for_silence(self) -> None:
        now = self._core.timers.now
        left = self.state.heard_at + SILENT_AFTER - now
        if left > 0:
            self._silence = self._core.timers.after(left, self._look_for_silence)
            return
        self._silence = None
        self.is_lost = True
        self._core.screen.notices.append(Shown(now, LOST))

    def _ask_for_gimbals(self, component: int) -> None:
        """Request it with each component's heartbeats, a few times [1.3]; the number is assumed."""
        if not self._core.profile.asks_gimbals:
            return
        asked = self._gimbals_asked.get(component, 0)
        if asked >= GIMBAL_TRIES:
            return
        self._gimbals_asked[component] = asked + 1

        def done(message: Message) -> None:
            if message is not None:
                self._gimbals_asked[component] = GIMBAL_TRIES

        name = "GIMBAL_MANAGER_INFORMATION"
        self._requests.ask(name, GIMBAL_MANAGER, done, component=component)
