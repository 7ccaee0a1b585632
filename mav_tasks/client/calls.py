"""Commands in flight to task servers, repeated until answered. Pure.

MAVLink guide, "Command Protocol". An ack names the command and not the request, so each (vehicle,
command id) is a lane with one call in flight at a time. A late copy of an ack must not answer the
next call. So the lane pauses until no more acks can arrive: after a refusal, an abandoned call, an
ack that could belong to another call, and a call that was sent more than once.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from mav_tasks.engine.services.retry import Retry
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavResult

AGAIN = 0.5  # s between copies; the server answers within that time
LATE = 0.6  # s for which acks of further copies may still arrive
MOST_CONFIRMED = 255

Command = m.CommandLong | m.CommandInt


class Answered(Protocol):
    """A callback for the answer to a command; ``ack`` None: time-out."""

    def __call__(self, ack: m.CommandAck | None, *, now: float) -> None: ...


@dataclass(slots=True)
class Call:
    """One command and the callback for its answer, ``done``, which is called at most once.

    ``fits`` returns whether an accepting ack can belong to this call. ``is_told_apart``: ``fits``
    identifies the ack, or a wrong match does no harm. ``is_urgent``: an immediate call sends one
    copy at once, even if its lane is busy.
    """

    message: Command
    give_up_after: float  # s from the first copy
    fits: Callable[[m.CommandAck], bool] = lambda _ack: True
    again: float = AGAIN
    is_told_apart: bool = True
    is_urgent: bool = False
    done: Answered = field(init=False)
    begun_at: float = 0.0
    retry: Retry | None = None


@dataclass(slots=True)
class _Lane:
    flying: Call | None = None
    waiting: deque[Call] = field(default_factory=deque)
    rests_until: float = 0.0


class Calls:
    """The lanes of one client, by vehicle and command id."""

    def __init__(self) -> None:
        self._lanes: dict[tuple[int, int], _Lane] = {}
        self._outgoing: list[Command] = []

    def __repr__(self) -> str:
        flying = [key for key, lane in self._lanes.items() if lane.flying]
        return f"Calls(flying={flying})"

    def begin(self, call: Call, *, now: float) -> None:
        """Send a command once the earlier calls of its lane have ended."""
        key = call.message.target_system, call.message.command
        lane = self._lanes.setdefault(key, _Lane())
        call.begun_at = now
        lane.waiting.append(call)
        self._advance(lane, now=now)
        if call.is_urgent and lane.flying is not call:
            self._outgoing.append(call.message)

    def receive(self, ack: m.CommandAck, *, vehicle: int, now: float) -> None:
        """Process an ack addressed to this client."""
        lane = self._lane_of(ack, vehicle)
        call = None if lane is None else lane.flying
        if lane is None or call is None or ack.result == MavResult.IN_PROGRESS:
            return
        if ack.result == MavResult.ACCEPTED and not call.fits(ack):
            return
        self._end(lane, ack, now=now)

    def settle(self, call: Call, *, is_answered: bool, now: float) -> None:
        """End a call without ``done``: another message answered it, or its caller stopped waiting.

        An ended call is left alone.
        """
        for lane in self._lanes.values():
            if lane.flying is call:
                self._rest(lane, is_ambiguous=not is_answered, now=now)
                self._advance(lane, now=now)
            elif call in lane.waiting:
                lane.waiting.remove(call)

    def next_deadline(self) -> float | None:
        """Return when to call ``handle_deadline``; None: no call is pending."""
        due = []
        for lane in self._lanes.values():
            if lane.flying is not None and lane.flying.retry is not None:
                due.append(lane.flying.retry.next_deadline())
            elif lane.waiting:
                due.append(lane.rests_until)
        return min(due, default=None)

    def handle_deadline(self, *, now: float) -> None:
        """Repeat the calls that are due, and end those that have timed out."""
        for lane in list(self._lanes.values()):
            call = lane.flying
            if call is not None and call.retry is not None:
                if call.retry.is_over(now):
                    self._give_up_waiting(lane, now=now)
                    self._end(lane, None, now=now)
                elif call.retry.is_due(now):
                    self._send(call, now=now)
            self._advance(lane, now=now)

    def take(self) -> list[Command]:
        """Return the commands to send since the last ``take``."""
        outgoing, self._outgoing = self._outgoing, []
        return outgoing

    def _lane_of(self, ack: m.CommandAck, vehicle: int) -> _Lane | None:
        lane = self._lanes.get((vehicle, ack.command))
        if lane is not None and lane.flying is not None:
            return lane
        return self._lanes.get((0, ack.command))  # a broadcast: any vehicle answers

    def _advance(self, lane: _Lane, *, now: float) -> None:
        if lane.flying is None and lane.waiting and now >= lane.rests_until:
            call = lane.flying = lane.waiting.popleft()
            call.retry = Retry.starting(
                now=now, interval=call.again, give_up_after=call.give_up_after
            )
            self._send(call, now=now)

    def _send(self, call: Call, *, now: float) -> None:
        assert call.retry is not None
        if isinstance(call.message, m.CommandLong):
            call.message.confirmation = min(call.retry.sent, MOST_CONFIRMED)
        call.retry.note_sent(now)
        self._outgoing.append(call.message)

    def _end(self, lane: _Lane, ack: m.CommandAck | None, *, now: float) -> None:
        call = lane.flying
        assert call is not None
        is_refused = ack is not None and ack.result != MavResult.ACCEPTED
        self._rest(lane, is_ambiguous=is_refused or not call.is_told_apart, now=now)
        call.done(ack, now=now)
        self._advance(lane, now=now)

    def _give_up_waiting(self, lane: _Lane, *, now: float) -> None:
        """End the waiting calls that would have timed out by now if sent."""
        for call in [each for each in lane.waiting if now >= each.begun_at + each.give_up_after]:
            lane.waiting.remove(call)
            call.done(None, now=now)

    def _rest(self, lane: _Lane, *, is_ambiguous: bool, now: float) -> None:
        call, lane.flying = lane.flying, None
        if is_ambiguous or (call is not None and call.retry is not None and call.retry.sent > 1):
            lane.rests_until = now + LATE
