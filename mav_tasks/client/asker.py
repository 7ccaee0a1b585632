"""Awaitable requests to task servers: each returns its answer, or raises Refused or NoAnswer."""

import asyncio
from collections.abc import Callable, Container, Iterator
from contextlib import contextmanager, suppress
from math import inf
from typing import Any, TypeVar

from mav_tasks.basics.errors import ClientError, NoAnswer, Refused
from mav_tasks.client.calls import AGAIN, Call, Command
from mav_tasks.client.connection import Connection
from mav_tasks.client.session import WORDS_WITHIN, Answer, Reply, request_message
from mav_tasks.client.values import (
    REFUSES,
    News,
    TaskStatus,
    TaskTiming,
    Text,
    VehicleChanged,
    queue_status_of,
)
from mav_tasks.engine.services.missions import Item, message_of
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavMissionResult, MavMissionType
from mav_tasks.mavlink.float_param import to_param
from mav_tasks.mavlink.special_values import FINISHED
from mav_tasks.tasks.lifecycle import TaskReason, TaskState

T = TypeVar("T")

ANSWER_WITHIN = 10.0  # s
PAGE_TRIES = 6
PARAMETER_TRIES = 4
BY_NAME = -1  # param_index of a request
PAGE_WITHIN = 0.3  # s to wait for the rest of a page after its ack
LATER = 1.0  # s until a rate-limited request is sent again
MOST_HEARD = 1000  # unread texts; later ones are dropped


class Asker:
    """The unanswered requests of one connection."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        #: with the command that calling it off ends
        self._pending: dict[asyncio.Future[Any], Command | None] = {}
        self._takers: set[Callable[[Answer, int], None]] = set()
        self._listening: set[asyncio.Queue[Text | None]] = set()
        self._listeners: set[Callable[[News], None]] = set()
        connection.session.on_answer = self._on_answer
        connection.session.on_text = self._on_text
        connection.session.on_vehicle = self._on_vehicle

    def __repr__(self) -> str:
        return f"Asker({self._connection!r}, {len(self._pending)} pending)"

    def close(self) -> None:
        """End the pending requests with ClientError, and the queues of texts."""
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
        """Send a command until it is answered. Return the result_param2 of its ack.

        Cancelling the await stops the repeats. A rate-limited command is sent again after LATER
        seconds. See Call for the other arguments.
        """
        loop = asyncio.get_running_loop()
        end, refused, left = loop.time() + within, None, within
        while True:
            call = Call(command, left, fits, again, is_told_apart, is_urgent)
            try:
                with self._future(int, command) as future:
                    self._begin(call, future, what, nonce=nonce)
                    try:
                        return await future
                    finally:
                        self._connection.settle(call, is_answered=False)
            except Refused as error:
                if error.reason != TaskReason.RATE_LIMITED or loop.time() + LATER > end:
                    raise
                refused = error
            except NoAnswer:
                if refused is not None:  # the refusal says more than a time-out
                    raise refused from None
                raise
            await asyncio.sleep(LATER)
            left = end - loop.time()

    def call_off(self, is_meant: Callable[[Command], bool], why: str) -> None:
        """Stop sending the unanswered commands that match; their callers get ClientError(why)."""
        for future, command in self._pending.items():
            if command is not None and is_meant(command) and not future.done():
                future.set_exception(ClientError(why))

    async def status(self, task_id: int, vehicle: int) -> TaskStatus:
        request = request_message(vehicle, m.TaskStatus.id, to_param(task_id))

        def is_meant(status: TaskStatus, _source: int) -> bool:
            return status.id == task_id

        return await self._shown(request, f"task {task_id}", TaskStatus, is_meant)

    async def timing(self, task_id: int, vehicle: int) -> TaskTiming:
        """Return how evenly the setpoints of a task left; 0: of the running task."""
        request = request_message(vehicle, m.TaskTiming.id, to_param(task_id))

        def is_meant(timing: TaskTiming, source: int) -> bool:
            return timing.id == task_id if task_id else source == vehicle

        what = f"the timing of task {task_id or 'that runs'}"
        return await self._shown(request, what, TaskTiming, is_meant)

    async def parameter(self, name: str, target: Address) -> float:
        """Return a parameter of a task server. Raise NoAnswer if that has none of this name."""
        session = self._connection.session
        with self._future(float) as future:

            def take(message: Answer, source: int) -> None:
                if not isinstance(message, m.ParamValue) or future.done():
                    return
                if message.param_id == name and source == target.system_id:
                    future.set_result(message.param_value)

            with _added(self._takers, take):
                for _ in range(PARAMETER_TRIES):
                    session.send(m.ParamRequestRead(*target, name.encode(), BY_NAME))
                    self._connection.turn()
                    await asyncio.wait((future,), timeout=AGAIN)
                    if future.done():
                        return future.result()
        raise NoAnswer(f"{target}: no parameter {name} was answered")

    async def overview(self, vehicle: int) -> m.TaskQueueStatus:
        request = request_message(vehicle, m.TaskQueueStatus.id)

        def is_meant(_message: m.TaskQueueStatus, source: int) -> bool:
            return source == vehicle

        what = f"the queue of rover {vehicle}"
        return await self._shown(request, what, m.TaskQueueStatus, is_meant)

    async def page(
        self, vehicle: int, first: int, count: int, *, begun: int, known: Container[int]
    ) -> list[TaskStatus]:
        """Return ``count`` waiting tasks, from place ``first`` on. Ask again if some are lost.

        ``begun`` is the number of active tasks: a task's position counts them, its place in the
        queue does not. ``known`` are the ids of earlier pages, whose statuses may still arrive.
        """
        # meanwhile any of the active tasks may end, and one task may start
        positions = range(first, first + count + begun + 1)

        def is_meant(status: TaskStatus) -> bool:
            is_unplaced = status.position is None and status.state is not TaskState.QUEUED
            return status.is_waiting and (is_unplaced or status.position in positions)

        request = request_message(vehicle, m.TaskStatus.id, 0.0, float(first))
        found = await self._gathered(request, vehicle, count, known=known, is_meant=is_meant)
        return sorted((status for status, _ in found), key=_place)

    async def finished(
        self, vehicle: int, first: int, count: int, *, known: Container[int]
    ) -> list[TaskStatus]:
        """Return ``count`` finished tasks, newest first. Ask again if some are lost.

        ``known`` are the ids of earlier pages, whose statuses may still arrive.
        """

        def is_meant(status: TaskStatus) -> bool:
            return status.ended_ago is not None  # else it is a change notification, not an answer

        request = request_message(vehicle, m.TaskStatus.id, 0.0, float(first), FINISHED)
        found = await self._gathered(request, vehicle, count, known=known, is_meant=is_meant)
        found.sort(key=lambda each: each[1] - (each[0].ended_ago or 0.0), reverse=True)
        return [status for status, _ in found]

    async def _gathered(
        self,
        request: m.CommandLong,
        vehicle: int,
        count: int,
        *,
        known: Container[int],
        is_meant: Callable[[TaskStatus], bool],
    ) -> list[tuple[TaskStatus, float]]:
        """Return the statuses that answer a request, each with its time of arrival."""
        found: dict[int, tuple[TaskStatus, float]] = {}
        whole, loop = asyncio.Event(), asyncio.get_running_loop()

        def take(status: Answer, source: int) -> None:
            if not isinstance(status, TaskStatus) or source != vehicle or status.id in known:
                return
            if is_meant(status):
                found[status.id] = status, loop.time()
                if len(found) >= count:
                    whole.set()

        with _added(self._takers, take):
            for _ in range(PAGE_TRIES):
                await self.ask(request, f"the tasks of rover {vehicle}", is_told_apart=True)
                with suppress(TimeoutError):  # the ack may arrive before the statuses
                    async with asyncio.timeout(PAGE_WITHIN):
                        await whole.wait()
                if whole.is_set():
                    break
        return list(found.values())

    async def upload(
        self, target: Address, items: tuple[Item, ...], kind: MavMissionType, *, nonce: int = 0
    ) -> int:
        """Upload a plan. Return its id. Raise ValueError if a number does not fit its field."""
        session = self._connection.session
        for seq, item in enumerate(items):
            session.check(message_of(item, seq, kind, to=target))
        with self.hearing() as heard:
            with self._future(tuple[MavMissionResult | None, int]) as future:

                def done(result: MavMissionResult | None, opaque_id: int) -> None:
                    while not heard.empty():  # the reason of a refusal follows it
                        heard.get_nowait()
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
                raise Refused(words, result=result, reason=opaque_id)
            return opaque_id

    async def download(self, target: Address, kind: MavMissionType) -> tuple[Item, ...]:
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
        """Yield a queue of the texts that arrive while this is open; None ends it.

        Not an async generator: ``shutdown_asyncgens`` closes all of them at once, so one that
        another one awaits would be closed twice.
        """
        heard: asyncio.Queue[Text | None] = asyncio.Queue(MOST_HEARD)
        with _added(self._listening, heard):
            yield heard

    @contextmanager
    def listening(self, listener: Callable[[News], None]) -> Iterator[None]:
        """Call ``listener`` with each piece of news while this is open."""
        with _added(self._listeners, listener):
            yield

    # internal

    @contextmanager
    def _future(
        self, _kind: type[T], command: Command | None = None
    ) -> Iterator[asyncio.Future[T]]:
        future: asyncio.Future[T] = asyncio.get_running_loop().create_future()
        self._pending[future] = command
        try:
            yield future
        finally:
            del self._pending[future]

    async def _shown(
        self,
        request: m.CommandLong,
        what: str,
        kind: type[T],
        is_meant: Callable[[T, int], bool],
    ) -> T:
        """Send a request until its message arrives. Its ack alone is no answer: it may be first."""
        answer: asyncio.Future[int] = asyncio.get_running_loop().create_future()
        with self._future(kind) as future:

            def take(message: Answer, source: int) -> None:
                if isinstance(message, kind) and is_meant(message, source) and not future.done():
                    future.set_result(message)

            with _added(self._takers, take):
                call = Call(request, ANSWER_WITHIN, lambda _ack: future.done())
                self._begin(call, answer, what)
                try:
                    await asyncio.wait((future, answer), return_when=asyncio.FIRST_COMPLETED)
                    return future.result() if future.done() else _raised(answer)
                finally:
                    answer.cancel()
                    self._connection.settle(call, is_answered=True)

    def _begin(self, call: Call, future: asyncio.Future[int], what: str, *, nonce: int = 0) -> None:
        def done(reply: Reply | None) -> None:
            if future.done():
                return
            if reply is None:
                words = f"{what}: no answer within {call.give_up_after:g} s"
                future.set_exception(NoAnswer(words, nonce=nonce))
            elif reply.is_accepted:
                future.set_result(reply.value)
            else:
                error = Refused(reply.words, result=reply.result, reason=reply.value)
                future.set_exception(error)

        self._connection.session.call(call, done, now=self._connection.now)
        self._connection.turn()

    # session callbacks

    def _on_answer(self, answer: Answer, vehicle: int) -> None:
        for take in list(self._takers):
            take(answer, vehicle)
        if isinstance(answer, TaskStatus):
            self._tell(answer)
        elif isinstance(answer, m.TaskQueueStatus):
            self._tell(queue_status_of(answer, vehicle, (), None))

    def _on_text(self, text: Text) -> None:
        for queue in self._listening:
            if not queue.full():  # a slow reader misses later texts
                queue.put_nowait(text)
        self._tell(text)

    def _on_vehicle(self, vehicle: int) -> None:
        if self._listeners:
            self._tell(VehicleChanged(vehicle))

    def _tell(self, news: News) -> None:
        for listener in list(self._listeners):
            listener(news)


@contextmanager
def _added(to: set[T], what: T) -> Iterator[None]:
    to.add(what)
    try:
        yield
    finally:
        to.discard(what)


def _place(status: TaskStatus) -> float:
    """Return the sort key: tasks without a position (SCHEDULED, BLOCKED) come last."""
    return inf if status.position is None else status.position


def _raised(answer: asyncio.Future[int]) -> Any:
    answer.result()
    raise AssertionError("an accepting ack does not end this call")


async def _words(heard: asyncio.Queue[Text | None], vehicle: int, *, otherwise: str) -> str:
    """Return the STATUSTEXT of a refusal, ``otherwise`` if none comes within WORDS_WITHIN."""
    try:
        async with asyncio.timeout(WORDS_WITHIN):
            while True:
                text = await heard.get()
                if text is None:
                    return otherwise
                if text.vehicle == vehicle and text.severity in REFUSES:
                    return text.words
    except TimeoutError:
        return otherwise.lower().replace("_", " ")
