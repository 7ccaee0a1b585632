"""Commands and their answers: those of clients as values, and those under way to one vehicle.

MAVLink guide, "Command Protocol". The very same packet of a client again is given the same answer
(``engine/clients/sender.py``); which submissions are the same task is the task domain's to say
(``tasks/deduplicator.py``).

To a vehicle there is a lane for each (component, command id), with one command in flight. An ack
names neither the request nor the asker, so a second command of the same lane waits until the first
is answered or given up, and for a while after it was given up a late ack is taken for the first
one's and dropped. Urgent commands (disarm, HOLD) never wait; the answer to one is for all clients
that ask for it. DEVIATION: our own repeats keep ``confirmation`` 0, because a vehicle carries each
copy out whatever it says.

A lane is shared fairly: our own commands go first, then those of higher ranks, then those of
clients that have fewer before them. Clients that ask for the same message share one request.
"""

from bisect import insort
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from math import inf
from typing import NamedTuple, TypeGuard

from mav_tasks.engine.services.retry import Retry
from mav_tasks.mavlink.address import Address, address_of
from mav_tasks.mavlink.enums import MavCmd, MavResult
from mav_tasks.mavlink.messages import CommandAck, CommandInt, CommandLong, Message
from mav_tasks.mavlink.packet import Packet

SAME_PACKET = 5.0  # s, the very same packet again: the same answer
REPEATED = 2.5  # s in which a client repeats what it has no answer to, MAVSDK at 0.5, 1.0 and 1.5
COPIED = 3.5  # s after a copy in which the next one comes: QGroundControl waits 3 s for an answer
DOUBLED = 30.0  # s, the same for what is a copy beyond doubt: a net may hold it for long


class Command(NamedTuple):
    """COMMAND_LONG or COMMAND_INT, on one footing.

    ``params`` are param1–param7; of a COMMAND_INT, 5 and 6 are its x and y as plain integers.
    ``frame`` is None for a COMMAND_LONG.
    """

    target: Address
    command: int
    params: tuple[float, float, float, float, float, float, float]
    confirmation: int
    frame: int | None
    message: CommandLong | CommandInt


#: of a command that came in none, and to make one for each takes its time
NO_MESSAGE = CommandInt(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)


def command_of(message: CommandLong | CommandInt) -> Command:
    target = address_of(message.target_system, message.target_component)
    first = (message.param1, message.param2, message.param3, message.param4)
    if isinstance(message, CommandInt):
        last = (float(message.x), float(message.y), message.z)
        return Command(target, message.command, first + last, 0, message.frame, message)
    last = (message.param5, message.param6, message.param7)
    return Command(target, message.command, first + last, message.confirmation, None, message)


def is_stop(message: Message | None) -> TypeGuard[CommandLong | CommandInt]:
    """Whether a message stops a vehicle; that others have a field for a command means nothing."""
    return isinstance(message, CommandLong | CommandInt) and message.command == MavCmd.TASK_STOP


class Answer(NamedTuple):
    """How a command was answered: everything of the ack but to whom."""

    command: int
    result: int
    result_param2: int
    source: Address
    result_param1: int = 0  # the ack's field ``progress``


REPEAT = 0.25  # s, between our own repeats
LATE = 0.4  # s, during which acks of a command given up are still expected
WORKING = 3.0  # s from one IN_PROGRESS to the next or to the end, as MAVSDK has it
IN_PROGRESS = MavResult.IN_PROGRESS
KEPT_LANES = 16  # beyond these, idle ones are forgotten
MAX_WAITING = 16  # commands of one id; beyond, the last in order is answered "busy" at once
LEFT_TO_ANSWER = 0.5  # of the time that a question waits: sent later, it seemed unanswered
MAX_EACH = 4  # commands of one id and one client, so that one alone does not fill a lane

#: commands that only ask: one answer is enough for all clients that ask the same
SHARED = frozenset({MavCmd.REQUEST_MESSAGE})


@dataclass(frozen=True, slots=True)
class Answered:
    """A command is over: ``ack`` is the vehicle's answer, None if it gave none in time.

    A client's may also be IN_PROGRESS; then it is not over.

    ``was_sent`` is False if the command never left, because others were before it.
    """

    origin: Hashable  # who asked; None: ourselves
    component: int
    command: int
    ack: CommandAck | None
    request: Message
    was_sent: bool


class Standing(NamedTuple):
    """Whose command it is, and how that client ranks: a higher rank goes first."""

    client: Hashable
    rank: float


OURS = Standing(None, inf)


_LaneKey = tuple[int, int]  # component, command id


@dataclass(slots=True)
class _Request:
    origin: Hashable
    lane: _LaneKey
    message: Message
    packet: Packet | None  # a client's, forwarded as it came; None: ours, to be encoded
    retry: Retry
    standing: Standing = OURS
    is_urgent: bool = False
    is_outdated: Callable[[], bool] = lambda: False  # while it waits; then it is not sent
    turn: int = 0  # commands of the same client that were before it in the lane
    joined: list["_Request"] = field(default_factory=list)  # of other clients, the same wish
    #: sent once, because each copy is carried out; the time for its answer counts from then
    is_once: bool = False
    goes_on_at: float = -inf  # when the vehicle last said so

    @property
    def owed_until(self) -> float:
        """Until when its answer may still come, if nobody waits for it any more.

        What is sent once is not answered until it is done, or IN_PROGRESS meanwhile.
        """
        sent_at = self.retry.sent_at
        return max(sent_at + (WORKING if self.is_once else LATE), self.goes_on_at + WORKING)

    @property
    def wait_until(self) -> float:
        """When it is given up unsent: a client's question leaves the vehicle time to answer."""
        is_question = self.standing is not OURS and self.lane[1] in SHARED
        return self.retry.give_up_at - LEFT_TO_ANSWER * self.retry.interval * is_question

    @property
    def order(self) -> tuple[float, int]:
        """What the commands that wait are sorted by."""
        return -self.standing.rank, self.turn


@dataclass(slots=True)
class _Lane:
    """All commands of one id."""

    in_flight: _Request | None = None
    waiting: list[_Request] = field(default_factory=list)  # in the order in which they are sent
    owed: int = 0  # acks still to come of commands that an urgent one has pushed aside
    owed_until: float = 0.0
    quiet_until: float = 0.0  # late acks may still come; nothing is sent meanwhile
    late: int = 0  # acks still to come of a command that was withdrawn; then it is quiet no more

    @property
    def requests(self) -> list[_Request]:
        """What is in flight and what waits."""
        return [*([self.in_flight] if self.in_flight else []), *self.waiting]

    def set_aside(self) -> None:
        """Forget what is in flight; nothing is sent that its late answer could be taken for."""
        assert self.in_flight is not None
        self.quiet_until, self.late = self.in_flight.owed_until, self.in_flight.retry.sent
        self.in_flight = None


class CommandSender:
    """The commands under way to one vehicle."""

    def __init__(self, source: Address) -> None:
        self._source = source  # of our own commands
        self._lanes: dict[_LaneKey, _Lane] = {}
        self._outgoing: list[Message | Packet] = []
        self._answers: list[Answered] = []

    def __repr__(self) -> str:
        flying = [command for (_, command), lane in self._lanes.items() if lane.in_flight]
        return f"CommandSender(in_flight={flying})"

    def request(
        self,
        message: CommandLong | CommandInt,
        *,
        now: float,
        give_up_after: float,
        immediate: bool = False,
        repeats: bool = True,
    ) -> None:
        """Send a command of our own, repeated until it is answered or given up.

        Without ``repeats`` it is sent once, and again by ``repeat``.
        """
        interval = REPEAT if repeats else give_up_after
        retry = Retry.starting(now=now, interval=interval, give_up_after=give_up_after)
        lane = (message.target_component, message.command)
        self._enqueue(_Request(None, lane, message, None, retry, is_urgent=immediate), now=now)

    def once(
        self,
        message: CommandLong | CommandInt,
        *,
        component: int,
        now: float,
        give_up_after: float,
        is_outdated: Callable[[], bool],
    ) -> None:
        """Send a command of our own once, which ``component`` answers; the time counts from then.

        If it is outdated when its turn comes, it is answered unsent.
        """
        retry = Retry.starting(now=now, interval=give_up_after, give_up_after=give_up_after)
        lane = (component, message.command)
        request = _Request(None, lane, message, None, retry, is_outdated=is_outdated)
        request.is_once = True
        self._enqueue(request, now=now)

    def drop(self, message: CommandLong | CommandInt) -> None:
        """Forget a command of our own: it is not sent any more, and has no answer."""
        for lane in self._lanes.values():
            lane.waiting = [each for each in lane.waiting if each.message is not message]
            flying = lane.in_flight
            if flying is not None and flying.message is message:
                lane.set_aside()

    def repeat(self, message: CommandLong | CommandInt, *, now: float) -> bool:
        """Send one copy more of a command of our own, which is given up as much later.

        False if none is in flight.
        """
        lane = self._lanes.get((message.target_component, message.command))
        flying = None if lane is None else lane.in_flight
        if flying is None or flying.origin is not None or flying.message != message:
            return False
        flying.retry.renew(now)
        self._send(flying, now=now)
        return True

    def relay(
        self,
        packet: Packet,
        message: Message,
        origin: Hashable,
        *,
        component: int,
        command: int,
        standing: Standing,
        now: float,
        give_up_after: float,
        immediate: bool = False,
        is_outdated: Callable[[], bool],
    ) -> None:
        """Forward a client's command once; its answer, or its lack of one, comes from ``take``.

        If it is outdated when its turn comes, it is answered unsent.
        """
        retry = Retry.starting(now=now, interval=give_up_after, give_up_after=give_up_after)
        lane = (component, command)
        request = _Request(origin, lane, message, packet, retry, standing, immediate, is_outdated)
        self._enqueue(request, now=now)

    def withdraw(self, component: int, command: int) -> None:
        """Send no further copy of our own commands of this id, and none that wait."""
        lane = self._lanes.get((component, command))
        if lane is None:
            return
        lane.waiting = [request for request in lane.waiting if request.origin is not None]
        if lane.in_flight is not None and lane.in_flight.origin is None:
            lane.set_aside()

    def cancel(self, component: int, command: int, *, now: float) -> None:
        """As ``withdraw``, and whatever clients wait for is answered: not by the vehicle."""
        self.withdraw(component, command)
        lane = self._lanes.get((component, command))
        if lane is None:
            return
        for request in lane.waiting:
            self._answer(request, None)
        lane.waiting.clear()
        if lane.in_flight is not None:  # it cannot be called back; its ack is not to be believed
            self._answer(lane.in_flight, None)
            lane.in_flight = None
            lane.quiet_until = now + LATE

    def is_pending(self, component: int, command: int) -> bool:
        """Whether a command of ours of this id is in flight or waits."""
        lane = self._lanes.get((component, command))
        return lane is not None and any(request.origin is None for request in lane.requests)

    def awaits(self, command: int) -> bool:
        """Whether a command of this id, ours or a client's, is in flight or waits."""
        return any(lane.requests for (_, each), lane in self._lanes.items() if each == command)

    def receive(self, ack: CommandAck, *, component: int, now: float) -> None:
        """Take an ack of a component of the vehicle; one that nobody waits for is dropped."""
        lane, is_over = self._lanes.get((component, ack.command)), ack.result != IN_PROGRESS
        if lane is None:
            return
        if lane.in_flight is None:
            self._take_late(lane, ack, is_over=is_over, now=now)
            return
        packet = lane.in_flight.packet
        asker = self._source if packet is None else packet.source
        if not Address(ack.target_system, ack.target_component).reaches(asker):
            return  # others may command the vehicle by another way
        if not is_over:
            self._goes_on(lane.in_flight, ack, now=now)
            return
        if lane.owed and now < lane.owed_until:  # the answer to what was pushed aside comes first
            lane.owed -= 1
            return
        request, lane.in_flight = lane.in_flight, None
        if request.retry.sent > 1:  # each copy is answered: the others' acks are on their way
            lane.quiet_until = now + LATE / 2
        self._answer(request, ack)
        self._advance(lane, now=now)

    def handle_deadline(self, *, now: float) -> None:
        """Repeat what is due and give up what is too old."""
        for lane in self._lanes.values():
            flying = lane.in_flight
            if flying is not None:
                for request in flying.joined:
                    if request.retry.is_over(now):
                        self._answer(request, None)
                flying.joined = [r for r in flying.joined if not r.retry.is_over(now)]
                if flying.retry.is_over(now):
                    lane.in_flight = None
                    lane.quiet_until = now + LATE
                    self._answer(flying, None)
            for request in [r for r in lane.waiting if now >= r.wait_until]:
                lane.waiting.remove(request)
                self._answer(request, None)
            self._advance(lane, now=now)
        if len(self._lanes) > KEPT_LANES:
            self._forget_idle_lanes(now)

    def _forget_idle_lanes(self, now: float) -> None:
        """Keep no lane that means nothing any more: a client can name 65,536 of them."""
        for key, lane in list(self._lanes.items()):
            if lane.in_flight is None and not lane.waiting and now >= lane.quiet_until:
                del self._lanes[key]

    def next_deadline(self) -> float:
        """Return when something is to be repeated or given up, s; inf without a command."""
        deadlines = [inf]
        for lane in self._lanes.values():
            if lane.in_flight is not None:
                deadlines.append(lane.in_flight.retry.next_deadline())
                deadlines += [request.retry.give_up_at for request in lane.in_flight.joined]
            if lane.waiting:
                deadlines.append(min(request.wait_until for request in lane.waiting))
                if lane.in_flight is None:
                    deadlines.append(lane.quiet_until)
        return min(deadlines)

    def take(self) -> tuple[list[Message | Packet], list[Answered]]:
        """Return what is to be sent, and what was answered, since the last call."""
        outgoing, self._outgoing = self._outgoing, []
        answers, self._answers = self._answers, []
        return outgoing, answers

    def _goes_on(self, request: _Request, ack: CommandAck, *, now: float) -> None:
        """Prolong the time for a command that the vehicle is carrying out; send no copy of it.

        What is urgent is repeated nevertheless: it halts the vehicle.
        """
        if request.is_urgent:
            return
        retry, request.goes_on_at = request.retry, now
        retry.give_up_at = retry.next_at = max(retry.give_up_at, now + WORKING)
        if request.origin is not None:
            self._answers.append(
                Answered(request.origin, *request.lane, ack, request.message, True)
            )

    def _take_late(self, lane: _Lane, ack: CommandAck, *, is_over: bool, now: float) -> None:
        """Let the lane go on after the last ack of a command of ours that was withdrawn."""
        is_ours = Address(ack.target_system, ack.target_component).reaches(self._source)
        if not lane.late or not is_ours:
            return
        if not is_over:
            if now < lane.quiet_until:
                lane.quiet_until = max(lane.quiet_until, now + WORKING)
            return
        lane.late -= 1
        if not lane.late:
            lane.quiet_until = now
            self._advance(lane, now=now)

    def _enqueue(self, request: _Request, *, now: float) -> None:
        if len(self._lanes) > KEPT_LANES:
            self._forget_idle_lanes(now)
        lane = self._lanes.setdefault(request.lane, _Lane())
        if request.is_urgent:
            for waiting in lane.waiting:  # after it they would undo what was urgent
                self._answer(waiting, None)
            lane.waiting.clear()
            flying = lane.in_flight
            are_clients = flying is not None and None not in (flying.packet, request.packet)
            if flying and flying.is_urgent and are_clients and _asks_the_same(flying, request):
                request.joined = [*flying.joined, flying]  # any answer is one for all of them
                flying.joined = []
            elif flying is not None:
                self._answer(flying, None)
                lane.owed, lane.owed_until = flying.retry.sent, now + LATE
            lane.in_flight = request
            self._send(request, now=now)
            return
        if request.standing is not OURS and not self._takes(lane, request):
            return
        insort(lane.waiting, request, key=lambda each: each.order)
        if len(lane.waiting) > MAX_WAITING:
            self._answer(lane.waiting.pop(), None)
        self._advance(lane, now=now)

    def _takes(self, lane: _Lane, request: _Request) -> bool:
        """Whether a client's command is to wait; else it has joined another, or is answered."""
        client = request.standing.client
        before = [each for one in lane.requests for each in (one, *one.joined)]
        request.turn = sum(
            each.standing.client == client and not each.is_outdated() for each in before
        )
        if request.turn >= MAX_EACH:
            self._answer(request, None)
            return False
        if request.lane[1] in SHARED:
            for other in lane.requests:
                if other.standing is not OURS and _asks_the_same(other, request):
                    other.joined.append(request)
                    return False
        return True

    def _advance(self, lane: _Lane, *, now: float) -> None:
        while lane.in_flight is None and lane.waiting and now >= lane.quiet_until:
            request = lane.waiting.pop(0)
            if request.is_outdated():
                self._answer(request, None)
            else:
                lane.in_flight = request
        flying = lane.in_flight
        if flying is not None and flying.retry.is_due(now):
            self._send(flying, now=now)

    def _send(self, request: _Request, *, now: float) -> None:
        if request.is_once and not request.retry.sent:
            request.retry.give_up_at += now - request.retry.next_at
        request.retry.note_sent(now)
        self._outgoing.append(request.message if request.packet is None else request.packet)

    def _answer(self, request: _Request, ack: CommandAck | None) -> None:
        was_sent = request.retry.sent > 0
        for each in (*request.joined, request):
            self._answers.append(Answered(each.origin, *each.lane, ack, each.message, was_sent))


def _asks_the_same(one: _Request, other: _Request) -> bool:
    return all(
        getattr(one.message, name) == getattr(other.message, name)
        for name in ("target_component", "param1", "param2", "param3", "param4")
    )
