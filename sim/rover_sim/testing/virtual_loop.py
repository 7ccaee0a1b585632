"""An asyncio loop in virtual time: instead of sleeping, it advances a world to its next event.

Tasks, timers and futures are asyncio's own. ``add_reader`` takes links of the world's net.
Everything that needs real time (sockets, processes, signals) is refused. Work for a thread runs at
once in the loop.
"""

import asyncio
import selectors
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from typing import Any, NoReturn, TypeVar, TypeVarTuple

from mav_tasks.links.memory import FIRST_NUMBER
from rover_sim.errors import NotInVirtualTime, Stalled
from rover_sim.testing.waiting import describe_tasks
from rover_sim.virtual import VirtualWorld

T = TypeVar("T")
Ts = TypeVarTuple("Ts")

Ready = list[tuple[selectors.SelectorKey, int]]

MOST_TURNS = 100_000  # turns of the loop at one time: a second or two of real time
NO_REAL_TIME = "is not possible in virtual time: give the code under test a link of the world's net"


class VirtualLoop(asyncio.SelectorEventLoop):
    """Runs in the time of a world; ``allow`` limits the time of one run."""

    def __init__(self, world: VirtualWorld) -> None:
        self._world = world
        self._pace = _Pace(world, self._stalled)
        super().__init__(self._pace)
        self._pace.is_sealed = True

    def time(self) -> float:
        """Return virtual seconds since the start of the world."""
        return self._world.now

    def allow(self, seconds: float, *, real_seconds: float) -> None:
        """Limit the time from now on; a run that needs more raises Stalled."""
        self._pace.allow(seconds, real_seconds)

    def run_in_executor(
        self,
        executor: Executor | None,  # noqa: ARG002
        func: Callable[[*Ts], T],
        *args: *Ts,
    ) -> asyncio.Future[T]:
        """Do the work at once, in virtual time zero: a thread would race with it."""
        done: asyncio.Future[T] = self.create_future()
        try:
            done.set_result(func(*args))
        except Exception as error:  # noqa: BLE001 (the awaiting task gets it)
            done.set_exception(error)
        return done

    def _stalled(self, why: str) -> Stalled:
        return Stalled(f"{why}; at {self._world.now:.3f} s{describe_tasks(self)}")


def _refusal(name: str) -> Callable[..., NoReturn]:
    def refuse(*_: object, **__: object) -> NoReturn:
        raise NotInVirtualTime(f"{name} {NO_REAL_TIME}")

    return refuse


for _name in (
    "add_signal_handler",
    "connect_accepted_socket",
    "connect_read_pipe",
    "connect_write_pipe",
    "create_connection",
    "create_datagram_endpoint",
    "create_server",
    "create_unix_connection",
    "create_unix_server",
    "getaddrinfo",
    "getnameinfo",
    "sendfile",
    "sock_accept",
    "sock_connect",
    "sock_recv",
    "sock_recv_into",
    "sock_recvfrom",
    "sock_recvfrom_into",
    "sock_sendall",
    "sock_sendfile",
    "sock_sendto",
    "start_tls",
    "subprocess_exec",
    "subprocess_shell",
):
    setattr(VirtualLoop, _name, _refusal(_name))


class _Pace(selectors.BaseSelector):
    """The loop's selector: it advances the world instead of waiting."""

    def __init__(self, world: VirtualWorld, stalled: Callable[[str], Stalled]) -> None:
        self._world = world
        self._stalled = stalled
        self._keys: dict[int, selectors.SelectorKey] = {}
        self._turns = 0  # since time last advanced
        self.is_sealed = False  # until then, the loop registers its own wake-up
        self.allow(0.0, 0.0)

    def allow(self, seconds: float, real_seconds: float) -> None:
        self._seconds, self._real_seconds = seconds, real_seconds
        self._end = self._world.now + seconds
        self._real_end = time.monotonic() + real_seconds
        self._turns = 0

    def register(self, fileobj: Any, events: int, data: Any = None) -> selectors.SelectorKey:
        number = fileobj if isinstance(fileobj, int) else fileobj.fileno()
        if self.is_sealed and number < FIRST_NUMBER:
            raise NotInVirtualTime(f"to wait for descriptor {number} {NO_REAL_TIME}")
        key = selectors.SelectorKey(fileobj, number, events, data)
        self._keys[number] = key
        return key

    def unregister(self, fileobj: Any) -> selectors.SelectorKey:
        return self._keys.pop(fileobj if isinstance(fileobj, int) else fileobj.fileno())

    def get_map(self) -> Mapping[Any, selectors.SelectorKey]:
        return self._keys

    def select(self, timeout: float | None = None) -> Ready:
        ready = list(self._ready())
        if ready or (timeout is not None and timeout <= 0):
            self._count_turn()
            return ready
        self._move(timeout)
        return list(self._ready())

    def _ready(self) -> Iterator[tuple[selectors.SelectorKey, int]]:
        for number, key in self._keys.items():
            if number >= FIRST_NUMBER and self._world.net.is_readable(number):
                yield key, selectors.EVENT_READ

    def _count_turn(self) -> None:
        self._turns += 1
        if self._turns > MOST_TURNS:
            raise self._stalled(
                f"the loop turned {MOST_TURNS} times and no time passed (sleep(0) in a loop? A"
                " reader that does not read?)"
            )

    def _move(self, timeout: float | None) -> None:
        """Advance the world to the next event, of the world or of the loop after ``timeout``."""
        if timeout is None and self._world.next_due() is None:
            raise self._stalled("deadlock: everything waits for something that never comes")
        if time.monotonic() > self._real_end:
            raise self._stalled(f"not over within {self._real_seconds:g} s of real time")
        end = self._end if timeout is None else min(self._end, self._world.now + timeout)
        self._turns = 0
        if not self._world.step(end=end) and end >= self._end:
            raise self._stalled(f"not over within {self._seconds:g} s of virtual time")
