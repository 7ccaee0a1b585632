"""The requests to a new vehicle, in this order, until it is connected [1.3], [11.1]."""

from collections.abc import Callable, Iterator
from itertools import cycle

from pymavlink.dialects.v20 import all as mavlink

from tests.kit.qgc.commands import SET_MESSAGE_INTERVAL, CommandQueue
from tests.kit.qgc.core import AUTOPILOT, Core
from tests.kit.qgc.parameters import Parameters
from tests.kit.qgc.plan_master import PlanMaster
from tests.kit.qgc.requests import MessageRequests
from tests.kit.qgc.vehicle import APM, GENERIC
from tests.kit.qgc.wire import Message

STREAMS = {1: 2, 2: 2, 3: 2, 6: 3, 10: 10, 11: 10, 12: 10}  # MAV_DATA_STREAM: Hz [1.2], [11.3]
STREAM_EACH, ROUNDS = 0.5, 5  # s [11.3]
MISSION_INT, COMMAND_INT, FENCE, RALLY, MAVLINK2 = 4, 8, 0x4000, 0x8000, 0x2000

Next = Callable[[], None]


class Connecting:
    """The initial connection to one vehicle, and the requests that run beside it."""

    def __init__(
        self,
        core: Core,
        firmware: str,
        commands: CommandQueue,
        requests: MessageRequests,
        plans: PlanMaster,
        fall_back: Callable[[], None],
    ) -> None:
        self._core = core
        self._firmware = firmware
        self._commands = commands
        self._requests = requests
        self._plans = plans
        self._fall_back = fall_back
        self.parameters = Parameters(core, firmware, self._parameters_ready)
        self.is_complete = False
        self._after_parameters: Next | None = None
        self._states = iter(self._order())

    def begin(self) -> None:
        """Start with the first state."""
        if self._firmware == APM and self._core.profile.streams_at_once:
            for number in STREAMS:
                self._ask_stream(number)
            self._ask_intervals()
        self._next()
        if self._firmware == APM and not self._core.profile.streams_at_once:
            self._ask_intervals()
            self._core.timers.live(self._ask_streams_slowly())

    def _order(self) -> list[Callable[[Next], None]]:
        profile, states = self._core.profile, [self._version]
        if profile.asks_protocol_version and self._firmware != APM:
            states.append(self._protocol)
        if profile.asks_modes:
            states.append(self._modes)
        return [*states, self._metadata, self._older_metadata, self._parameters, self._missions]

    def _next(self) -> None:
        state = next(self._states, None)
        if state is not None:
            state(self._next)
            return
        self.is_complete = True

    def _version(self, then: Next) -> None:
        def done(message: Message) -> None:
            if message is None:  # [1.3]
                assumed = (
                    0 if self._firmware == GENERIC else (MISSION_INT | COMMAND_INT | FENCE | RALLY)
                )
                self._plans.capabilities = MAVLINK2 | assumed
            else:
                self._plans.capabilities = message.capabilities
            then()

        self._requests.ask("AUTOPILOT_VERSION", 148, done)

    def _protocol(self, then: Next) -> None:
        def done(message: Message) -> None:
            if message is None:  # [11.1]: no popup, but no fence and rally points from then on
                self._fall_back()
                self._plans.capabilities &= ~(FENCE | RALLY)
                self._core.violation("the whole link fell back to MAVLink 1")
            then()

        self._requests.ask("PROTOCOL_VERSION", 300, done)

    def _modes(self, then: Next) -> None:
        """Request the modes one by one, up to the number in the first answer [1.3]."""

        def ask(index: int) -> None:
            self._requests.ask("AVAILABLE_MODES", 435, done, index=index)

        def done(message: Message) -> None:
            if message is not None and message.mode_index < message.number_modes:
                ask(message.mode_index + 1)
            else:
                then()

        ask(1)

    def _metadata(self, then: Next) -> None:
        self._requests.ask("COMPONENT_METADATA", 397, lambda _: then())

    def _older_metadata(self, then: Next) -> None:
        self._requests.ask("COMPONENT_INFORMATION", 395, lambda _: then())

    def _parameters(self, then: Next) -> None:
        self._after_parameters = then
        self.parameters.load()

    def _parameters_ready(self) -> None:
        for _ in range(2):  # [1.3], [11.1]
            self._core.send(mavlink.MAVLink_system_time_message(0, 0))
        assert self._after_parameters is not None, "they are ready once"
        self._after_parameters()

    def _missions(self, then: Next) -> None:
        self._plans.download(then)

    # ArduPilot only

    def _ask_intervals(self) -> None:
        for number in self._core.profile.intervals:
            self._commands.send_long(SET_MESSAGE_INTERVAL, number, 1e6, shows_errors=False)

    def _ask_stream(self, number: int) -> None:
        ask = mavlink.MAVLink_request_data_stream_message
        self._core.send(ask(self._core.system, AUTOPILOT, number, STREAMS[number], 1))

    def _ask_streams_slowly(self) -> Iterator[float]:
        numbers = cycle(STREAMS)
        for _ in range(ROUNDS * len(STREAMS)):
            yield STREAM_EACH
            self._ask_stream(next(numbers))
