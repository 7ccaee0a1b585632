"""The parameters of every component of one vehicle: reading, and popups if some do not come."""

from collections.abc import Callable
from dataclasses import dataclass, field

from pymavlink.dialects.v20 import all as mavlink

from tests.kit.qgc.core import AUTOPILOT, Core
from tests.kit.qgc.timers import Timer
from tests.kit.qgc.vehicle import APM, GENERIC, PX4
from tests.kit.qgc.wire import Message

LIST_EACH, LIST_TRIES = 5.0, 5  # s [1.4], [11.1]
HASH_WAIT = 1.0  # s [1.4]
FTP_WAIT, FTP_TRIES = 1.0, 3  # s; assumed: "silence costs FTP retries"
MISSING_WAIT = 3.0  # s without a value; assumed
UNNUMBERED = 65535
HASH = "_HASH_CHECK"
PACKED_FILE = b"@PARAM/param.pck?withdefaults=1"
OPEN_FILE, NAK, ACK = 4, 129, 128

NO_ANSWER = (
    "Vehicle {} did not respond to request for parameters. This will cause QGroundControl to be"
    " unable to display its full user interface."
)
NOT_ALL = "QGroundControl was unable to retrieve the full set of parameters from vehicle {}."


@dataclass(slots=True)
class Component:
    """The known parameters of one component."""

    count: int
    names: set[str] = field(default_factory=set)
    missing: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.missing = set(range(self.count))


class Parameters:
    """Reads all parameters once."""

    def __init__(self, core: Core, firmware: str, ready: Callable[[], None]) -> None:
        self._core = core
        self._firmware = firmware
        self._ready = ready
        self.components: dict[int, Component] = {}
        self.is_ready = False
        self._asks_file = False
        self._asks_hash = False
        self._has_asked = False
        self._list_tries = 0
        self._timer: Timer | None = None

    def load(self) -> None:
        """Start: by file from ArduPilot, by the hash from PX4, else by the list [1.4]."""
        if self._firmware == APM:
            self._asks_file = True
            self._ask_file(1)
        elif self._firmware == PX4 and self._core.profile.checks_hash:
            self._asks_hash = True
            self._core.send(
                mavlink.MAVLink_param_request_read_message(
                    self._core.system, AUTOPILOT, HASH.encode(), -1
                )
            )
            self._wait(HASH_WAIT, self._ask_list)
        else:
            self._ask_list()

    def receive(self, message: Message, component: int) -> None:
        """Take a PARAM_VALUE of any component of the vehicle."""
        name: str = message.param_id
        if self._asks_file:
            return  # [1.4]
        if name == HASH:
            if self._asks_hash:
                self._ask_list()  # there is no cache, so it never matches
            return
        if message.param_index == UNNUMBERED and not self._has_asked:
            return  # [1.4]
        known = self.components.get(component)
        if known is None:
            known = self.components[component] = Component(message.param_count)
        known.names.add(name)
        known.missing.discard(message.param_index)
        if not self.is_ready:
            self._list_tries = 0
            if all(not each.missing for each in self.components.values()) and (
                AUTOPILOT in self.components
            ):
                self._end()
            else:
                self._wait(MISSING_WAIT, self._not_all)

    def receive_file(self, message: Message) -> None:
        """Take an answer about the packed file; after a NAK, request the list [11.3]."""
        if not self._asks_file or message.payload[5] != OPEN_FILE:
            return
        if message.payload[3] == NAK:
            self._asks_file = False
            self._ask_list()
        elif message.payload[3] == ACK:
            raise NotImplementedError("parameters by file")

    def _ask_file(self, tries: int) -> None:
        if tries > FTP_TRIES:
            self._asks_file = False
            self._ask_list()
            return
        payload = [tries, 0, 0, OPEN_FILE, len(PACKED_FILE), 0, 0, 0, 0, 0, 0, 0, *PACKED_FILE]
        payload += [0] * (251 - len(payload))
        self._core.send(
            mavlink.MAVLink_file_transfer_protocol_message(0, self._core.system, AUTOPILOT, payload)
        )
        self._wait(FTP_WAIT, lambda: self._ask_file(tries + 1))

    def _ask_list(self) -> None:
        self._asks_hash = False
        self._has_asked = True
        if self._list_tries >= LIST_TRIES:
            if self._firmware != GENERIC:  # no popup [1.4]
                self._core.popup(NO_ANSWER.format(self._core.system))
            return
        self._list_tries += 1
        self._core.send(mavlink.MAVLink_param_request_list_message(self._core.system, 0))
        self._wait(LIST_EACH, self._ask_list)

    def _not_all(self) -> None:
        """Complain at once: it would ask for them again, but here none is lost [1.4]."""
        self._core.popup(NOT_ALL.format(self._core.system))

    def _end(self) -> None:
        self.is_ready = True
        if self._timer is not None:
            self._timer.cancel()
        self._ready()

    def _wait(self, seconds: float, call: Callable[[], None]) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._core.timers.after(seconds, call)
