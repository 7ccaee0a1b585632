"""REQUEST_MESSAGE with its results: one at a time per component [1.3]."""

from collections import defaultdict, deque
from collections.abc import Callable
from typing import NamedTuple

from tests.kit.qgc.commands import ACCEPTED, REQUEST_MESSAGE, CommandQueue
from tests.kit.qgc.core import AUTOPILOT, Core
from tests.kit.qgc.timers import Timer
from tests.kit.qgc.wire import Message

MESSAGE_AFTER_ACK = 1.0  # s [1.3]

#: called with the message, or None
Done = Callable[[Message], None]


class _Request(NamedTuple):
    name: str
    number: int
    param2: float
    done: Done


class MessageRequests:
    """Requests messages from one vehicle."""

    def __init__(self, core: Core, commands: CommandQueue) -> None:
        self._core = core
        self._commands = commands
        self._waiting: dict[int, deque[_Request]] = defaultdict(deque)
        self._current: dict[int, _Request] = {}
        self._came: dict[int, Message] = {}
        self._is_acked: set[int] = set()
        self._timers: dict[int, Timer] = {}

    def ask(
        self, name: str, number: int, done: Done, *, component: int = AUTOPILOT, index: float = 0
    ) -> None:
        """Request a message after the pending requests."""
        self._waiting[component].append(_Request(name, number, index, done))
        self._next(component)

    def receive(self, name: str, message: Message, component: int) -> None:
        """Take a message; it may come before or after the ack [1.3]."""
        request = self._current.get(component)
        if request is None or request.name != name:
            return
        self._came.setdefault(component, message)
        if component in self._is_acked:
            self._end(component)

    def _next(self, component: int) -> None:
        if component in self._current or not self._waiting[component]:
            return
        request = self._current[component] = self._waiting[component].popleft()
        self._commands.send_long(
            REQUEST_MESSAGE,
            request.number,
            request.param2,
            component=component,
            handler=lambda result: self._acked(component, result),
        )

    def _acked(self, component: int, result: int | None) -> None:
        if result != ACCEPTED or component in self._came:
            self._end(component)
            return
        self._is_acked.add(component)
        self._timers[component] = self._core.timers.after(
            MESSAGE_AFTER_ACK, lambda: self._end(component)
        )

    def _end(self, component: int) -> None:
        request = self._current.pop(component)
        self._is_acked.discard(component)
        timer = self._timers.pop(component, None)
        if timer is not None:
            timer.cancel()
        request.done(self._came.pop(component, None))
        self._next(component)
