"""Questions to task servers, as things to await. Refused and NoAnswer say what came of them."""

import asyncio
from collections.abc import Callable, Container, Iterator
from contextlib import contextmanager, suppress
from math import inf
from typing import Any, TypeVar

from mav_tasks.client.calls import AGAIN, Call, Command
from mav_tasks.client.connection import Connection
from mav_tasks.client.session import WORDS_WITHIN, Reply, request_message
from mav_tasks.client.values import TaskStatus, TaskTiming, Text
from mav_tasks.errors import ClientError, NoAnswer, Refused
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavMissionResult, MavMissionType, MavSeverity
from mav_tasks.mavlink.float_param import to_param
from mav_tasks.services.mission_item import Item, message_of
from mav_tasks.tasks.lifecycle import TaskReason, TaskState

T = TypeVar("T")

ANSWER_WITHIN = 10.0  # s
PAGE_TRIES = 6
PAGE_WITHIN = 0.3  # s after its ack, in which the rest of a page comes
FINISHED = 1.0  # param4 of REQUEST_MESSAGE: tasks that are over
LATER = 1.0  # s, after which what was one request too many is sent again
MOST_HEARD = 1000  # texts that wait to be read


class Asker:
    """What is asked on one connection, until it is answered."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._pending: set[asyncio.Future[Any]] = set()
        self._statuses: set[Callable[[TaskStatus], None]] = set()
        self._queues: set[Callable[[m.TaskQueueStatus, int], None]] = set()
        self._timings: set[Callable[[TaskTiming], None]] = set()
        self._asked: dict[asyncio.Future[int], Command] = {}
        self._listening: set[asyncio.Queue[Text | None]] = set()
        session = connection.session
        session.on_status = self._on_status
        session.on_queue = self._on_queue
        session.on_timing = self._on_timing
        session.on_text = self._on_text

    def __repr__(self) -> str:
        return f"Asker({self._connection!r}, {len(self._pending)} pending)"

    def close(self) -> None:
        """Tell who still waits that nothing will come."""
        for future in self._pending:
            if not future.done():
                future.set_exception(ClientError("the client was closed"))
        for queue in self._listening:
            if queue.full():
                queue.get_nowait()
            queue.put_nowait(None)

    async def ask(
        self,
        command: Command,
        what: str,
        *,
        within: float = ANSWER_WITHIN,
        again: float = AGAIN,
        fits: Callable[[m.CommandAck], bool] = lambda _ack: True,
        nonce: int = 0,
        is_told_apart: bool = False,
        is_urgent: bool = False,
    ) -> int:
        """Send a command until it is answered; gives the answer's result_param2.

        Who stops waiting has it sent no more. One that was one too many is asked again after a
        while. See Call for the rest.
        """
        loop = asyncio.get_running_loop()
        end, refused, left = loop.time() + within, None, within
        while True:
            try:
                return await self._ask_once(
                    command,
                    what,
                    within=left,
                    again=again,
                    fits=fits,
                    nonce=nonce,
                    is_told_apart=is_told_apart,
                    is_urgent=is_urgent,
                )
            except Refused as error:
                if error.reason != TaskReason.RATE_LIMITED or loop.time() + LATER > end:
                    raise
                refused = error
            except NoAnswer:
                if refused is not None:  # it may have ended since: why it did not is known
                    raise refused from None
                raise
            await asyncio.sleep(LATER)
            left = end - loop.time()

    async def _ask_once(
        self,
        command: Command,
        what: str,
        *,
        within: float,
        again: float,
        fits: Callable[[m.CommandAck], bool],
        nonce: int,
        is_told_apart: bool,
        is_urgent: bool,
    ) -> int:
        with self._future(int) as future:
            call = self._call(
                command,
                future,
                what,
                within=within,
                again=again,
                fits=fits,
                nonce=nonce,
                is_told_apart=is_told_apart,
                is_urgent=is_urgent,
            )
            self._asked[future] = command
            try:
                return await future
            finally:
                del self._asked[future]
                self._connection.settle(call, is_answered=False)

    def call_off(self, is_meant: Callable[[Command], bool], why: str) -> None:
        """Have commands that are still unanswered sent no more, and tell who waits for them."""
        for future, command in self._asked.items():
            if is_meant(command) and not future.done():
                future.set_exception(ClientError(why))

    async def status(self, task_id: int, vehicle: int) -> TaskStatus:
        """Ask how a task is."""
        request = request_message(vehicle, m.TaskStatus.id, to_param(task_id))
        with self._future(TaskStatus) as future:

            def take(status: TaskStatus) -> None:
                if status.id == task_id and not future.done():
                    future.set_result(status)

            with _added(self._statuses, take):
                return await self._shown(future, request, f"task {task_id}")

    async def timing(self, task_id: int, vehicle: int) -> TaskTiming:
        """Ask how evenly the setpoints of a task left; 0: of the running one."""
        request = request_message(vehicle, m.TaskTiming.id, to_param(task_id))
        with self._future(TaskTiming) as future:

            def take(timing: TaskTiming) -> None:
                is_meant = timing.id == task_id if task_id else timing.vehicle == vehicle
                if is_meant and not future.done():
                    future.set_result(timing)

            with _added(self._timings, take):
                what = f"the timing of task {task_id or 'that runs'}"
                return await self._shown(future, request, what)

    async def overview(self, vehicle: int) -> m.TaskQueueStatus:
        """Ask for a queue as a whole."""
        request = request_message(vehicle, m.TaskQueueStatus.id)
        with self._future(m.TaskQueueStatus) as future:

            def take(message: m.TaskQueueStatus, source: int) -> None:
                if source == vehicle and not future.done():
                    future.set_result(message)

            with _added(self._queues, take):
                return await self._shown(future, request, f"the queue of rover {vehicle}")

    async def page(
        self, vehicle: int, first: int, count: int, *, begun: int, known: Container[int]
    ) -> list[TaskStatus]:
        """Ask for waiting tasks by their place; if some are lost on the way, again.

        ``begun`` is how many tasks have begun: a position counts them, the place in the queue does
        not. ``known`` are those of earlier pages, which may still come.
        """
        found: dict[int, TaskStatus] = {}
        # any number of them may end meanwhile, and one may begin
        positions = range(first, first + count + begun + 1)
        whole = asyncio.Event()

        def take(status: TaskStatus) -> None:
            if status.vehicle != vehicle or not status.is_waiting or status.id in known:
                return
            is_unplaced = status.position is None and status.state is not TaskState.QUEUED
            if is_unplaced or status.position in positions:
                found[status.id] = status
                if len(found) >= count:
                    whole.set()

        request = request_message(vehicle, m.TaskStatus.id, 0.0, float(first))
        await self._until_whole(request, take, whole, vehicle)
        return sorted(found.values(), key=_place)

    async def finished(
        self, vehicle: int, first: int, count: int, *, known: Container[int]
    ) -> list[TaskStatus]:
        """Ask for tasks that are over, newest first; if some are lost on the way, again.

        ``known`` are those of earlier pages, which may still come.
        """
        found: dict[int, tuple[float, TaskStatus]] = {}  # with when it ended
        whole, loop = asyncio.Event(), asyncio.get_running_loop()

        def take(status: TaskStatus) -> None:
            if status.vehicle != vehicle or status.ended_ago is None or status.id in known:
                return  # without its age it is no answer to a question, but news
            found.setdefault(status.id, (loop.time() - status.ended_ago, status))
            if len(found) >= count:
                whole.set()

        request = request_message(vehicle, m.TaskStatus.id, 0.0, float(first), FINISHED)
        await self._until_whole(request, take, whole, vehicle)
        newest = sorted(found.values(), key=lambda each: each[0], reverse=True)
        return [status for _, status in newest]

    async def _until_whole(
        self,
        request: m.CommandLong,
        take: Callable[[TaskStatus], None],
        whole: asyncio.Event,
        vehicle: int,
    ) -> None:
        with _added(self._statuses, take):
            for _ in range(PAGE_TRIES):
                await self.ask(request, f"the tasks of rover {vehicle}", is_told_apart=True)
                with suppress(TimeoutError):  # the ack may overtake what it announces
                    async with asyncio.timeout(PAGE_WITHIN):
                        await whole.wait()
                if whole.is_set():
                    return

    async def upload(
        self, target: Address, items: tuple[Item, ...], kind: MavMissionType, *, nonce: int = 0
    ) -> int:
        """Send a plan; gives the id that it has there. ValueError: a number that none can carry."""
        session = self._connection.session
        for seq, item in enumerate(items):
            session.check(message_of(item, seq, kind, to=target))
        with self.hearing() as heard:
            with self._future(tuple[MavMissionResult | None, int]) as future:

                def done(result: MavMissionResult | None, opaque_id: int) -> None:
                    if not future.done():
                        future.set_result((result, opaque_id))

                transfers = session.transfers(target)
                transfers.upload(kind, items, done, now=self._connection.now)
                self._connection.turn()
                try:
                    result, opaque_id = await future
                finally:
                    transfers.drop(done)
            if result is None:
                raise NoAnswer(f"{target}: the upload was not answered", nonce=nonce)
            if result != MavMissionResult.ACCEPTED:
                words = await _words(heard, target.system_id, otherwise=result.name)
                raise Refused(words, result=result, reason=0)
            return opaque_id

    async def download(self, target: Address, kind: MavMissionType) -> tuple[Item, ...]:
        """Fetch a plan."""
        with self._future(tuple[Item, ...]) as future:

            def done(items: tuple[Item, ...] | None, refused: MavMissionResult | None) -> None:
                if future.done():
                    return
                if items is not None:
                    future.set_result(items)
                elif refused is not None:
                    future.set_exception(Refused(refused.name, result=refused, reason=0))
                else:
                    future.set_exception(NoAnswer(f"{target}: the download was not answered"))

            transfers = self._connection.session.transfers(target)
            transfers.download(kind, done, now=self._connection.now)
            self._connection.turn()
            return await future

    @contextmanager
    def hearing(self) -> Iterator[asyncio.Queue[Text | None]]:
        """Return a queue of the texts that come while this is open; None: there will be no more.

        Not an asynchronous generator: a loop that ends closes all of those at once, and one that
        waits inside another is then closed twice.
        """
        heard: asyncio.Queue[Text | None] = asyncio.Queue(MOST_HEARD)
        with _added(self._listening, heard):
            yield heard

    # inside

    @contextmanager
    def _future(self, _kind: type[T]) -> Iterator[asyncio.Future[T]]:
        future: asyncio.Future[T] = asyncio.get_running_loop().create_future()
        with _added(self._pending, future):
            yield future

    async def _shown(self, future: asyncio.Future[T], request: m.CommandLong, what: str) -> T:
        """Ask until what is asked for has come: the ack alone is no answer, it may overtake it."""
        answer: asyncio.Future[int] = asyncio.get_running_loop().create_future()
        call = self._call(request, answer, what, fits=lambda _ack: future.done())
        try:
            await asyncio.wait((future, answer), return_when=asyncio.FIRST_COMPLETED)
            return future.result() if future.done() else _raised(answer)
        finally:
            answer.cancel()
            self._connection.settle(call, is_answered=True)

    def _call(
        self,
        command: Command,
        future: asyncio.Future[int],
        what: str,
        *,
        within: float = ANSWER_WITHIN,
        again: float = AGAIN,
        fits: Callable[[m.CommandAck], bool] = lambda _ack: True,
        nonce: int = 0,
        is_told_apart: bool = True,
        is_urgent: bool = False,
    ) -> Call:
        def done(reply: Reply | None) -> None:
            if future.done():
                return
            if reply is None:
                words = f"{what}: no answer within {within:g} s"
                future.set_exception(NoAnswer(words, nonce=nonce))
            elif reply.is_accepted:
                future.set_result(reply.value)
            else:
                error = Refused(reply.words, result=reply.result, reason=reply.value)
                future.set_exception(error)

        connection = self._connection
        call = connection.session.call(
            command,
            done,
            now=connection.now,
            within=within,
            again=again,
            fits=fits,
            is_told_apart=is_told_apart,
            is_urgent=is_urgent,
        )
        connection.turn()
        return call

    # what the session tells

    def _on_status(self, status: TaskStatus) -> None:
        for take in list(self._statuses):
            take(status)

    def _on_queue(self, message: m.TaskQueueStatus, vehicle: int) -> None:
        for take in list(self._queues):
            take(message, vehicle)

    def _on_timing(self, timing: TaskTiming) -> None:
        for take in list(self._timings):
            take(timing)

    def _on_text(self, text: Text) -> None:
        for queue in self._listening:
            if not queue.full():  # who does not read misses what comes
                queue.put_nowait(text)


@contextmanager
def _added(to: set[T], what: T) -> Iterator[None]:
    to.add(what)
    try:
        yield
    finally:
        to.discard(what)


def _place(status: TaskStatus) -> float:
    """Those that wait for a time or another task have none, and come last."""
    return inf if status.position is None else status.position


def _raised(answer: asyncio.Future[int]) -> Any:
    answer.result()
    raise AssertionError("an accepting ack does not end this call")


async def _words(heard: asyncio.Queue[Text | None], vehicle: int, *, otherwise: str) -> str:
    """Wait a moment for the words of a refusal."""
    try:
        async with asyncio.timeout(WORDS_WITHIN):
            while True:
                text = await heard.get()
                if text is None:
                    return otherwise
                if text.vehicle == vehicle and text.severity == MavSeverity.WARNING:
                    return text.words
    except TimeoutError:
        return otherwise.lower().replace("_", " ")
