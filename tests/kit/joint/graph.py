"""The graph of joint control: every state that the table reaches, from the first of each make."""

import gc
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from itertools import product
from typing import Any

from mav_tasks.engine.vehicles.control import STANDS, TABLE, Driver, Event, Grip, Queue, State, Work
from tests.kit.joint.model import FREE, MAKES, START, Known, forget, happens, others_do, passes

#: per event, the conditions of its rows that the graph leaves open
ASKED = {
    event: tuple(
        name for name in FREE if any(name in row.where for row in TABLE if row.event is event)
    )
    for event in Event
}


TIME, PEOPLE = "time", "people"  # other causes of transitions


@contextmanager
def without_collector() -> Iterator[None]:
    """Let no garbage be looked for: millions of objects are made, and all of them are kept."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def can_happen(event: Event, state: State) -> bool:
    """Return whether an event is possible in a state; requests always are."""
    has_task = state.work not in (Work.NONE, Work.WAITS)
    match event:
        case Event.CANCEL:
            return has_task
        case Event.SKIP | Event.RELEASE | Event.RESTORE:
            return state.work in (Work.STANDS, Work.WAITS)
        case Event.LATE | Event.TOO_FAST | Event.NOT_STANDING:
            return state.work is Work.RUNS
        case Event.MODE_IN_STOP:
            return state.queue is Queue.STOPPED
        case Event.PARKED:  # the mode change was handled before
            rests = state.work in STANDS and not state.waits and not state.is_urgent
            return state.queue is not Queue.STOPPED and rests
        case Event.MODE | Event.LATE_MODE | Event.EXPLAINED | Event.GO_ON:
            return state.queue is not Queue.STOPPED
        case Event.LAPSED:
            return state.queue is not Queue.STOPPED and state.grip in (Grip.TAKING, Grip.DRIVING)
        case Event.DISARMED:  # the heartbeat shows it disarmed
            return state.armed and state.grip is not Grip.STOPPING
        case Event.RUN_NOW:
            return state.queue is not Queue.STOPPED
        case Event.COME_BACK | Event.COME_BACK_DRIVEN | Event.COME_BACK_LED_AWAY:
            return state.grip is Grip.FREE and not has_task
        case Event.COME_BACK_DRIVING:
            is_met = state.grip is Grip.FREE and state.driver is Driver.NOBODY
            return is_met and not has_task and state.armed
        case Event.COME_BACK_HALTED:
            return state.grip is Grip.FREE and not has_task and state.armed
        case Event.CLOSE | Event.LEAVE:
            return False  # final: nothing follows
        case _:
            return True


def variants(event: Event, state: State) -> Iterator[State]:
    """Yield the state with each combination of the conditions that the event's rows have."""
    names = ASKED[event]
    if not names:
        yield state
        return
    for values in product((False, True), repeat=len(names)):
        asked: dict[str, Any] = dict(zip(names, values, strict=True))
        if asked.get("may_be_armed", True) or not state.armed:
            yield state._replace(**asked)


def after(event: Event, state: State) -> frozenset[State]:
    """Return the states to which an event can lead."""
    found = [all_plain(happens(event, each)) for each in variants(event, state)]
    return found[0] if len(found) == 1 else frozenset().union(*found)


@cache
def all_plain(states: frozenset[State]) -> frozenset[State]:
    """Return what ``plain`` makes of the states."""
    return frozenset().union(*map(plain, states))


@cache
def plain(state: State) -> tuple[State, ...]:
    """Return a state without open conditions, and with one waiting effect at a time.

    Each of several waiting effects is removed or takes effect independently of the others.
    """
    state = state._replace(
        may_be_armed=False, is_idle=True, is_stopping=False, is_late=False, brakes=False
    )
    if len(state.waits) < 2:
        return (state,)
    return tuple(state._replace(waits=each) for each in state.waits)


class Graph:
    """Every state of one make of vehicle, with its transitions."""

    def __init__(self, make: str) -> None:
        make_of: dict[str, Any] = {**MAKES[make]}
        first = Known._make(START._replace(**make_of))
        #: each state, with the path to it from the first
        self.paths: dict[State, tuple[str, ...]] = {first: ()}
        #: each state's events, with the states to which they lead
        self.leads: dict[State, dict[str, frozenset[State]]] = {}
        with without_collector():
            self._explore(first)
        forget()
        all_plain.cache_clear()

    def _explore(self, first: State) -> None:
        # Share equal sets: there are hundreds of thousands. An old one leads to no new state.
        once: dict[frozenset[State], frozenset[State]] = {}
        waiting = deque([first])
        while waiting:
            state = waiting.popleft()
            ways = self.leads[state] = {}
            for name, found in _leads(state):
                ways[name] = once.setdefault(found, found)
                for there in found if ways[name] is found else ():
                    if there not in self.paths:
                        self.paths[there] = (*self.paths[state], name)
                        waiting.append(there)

    def leading_to(
        self,
        wanted: Callable[[State], bool],
        *names: str,
        within: Callable[[State], bool] = lambda _state: True,
    ) -> set[State]:
        """Return the states from which transitions with these names lead to a wanted state.

        All states on the path satisfy ``within``.
        """
        into: dict[State, list[State]] = {}
        for state, ways in self.leads.items():
            if within(state):
                for name in names:
                    for there in ways.get(name, ()):
                        into.setdefault(there, []).append(state)
        found = {state for state in self.paths if wanted(state)}
        waiting = list(found)
        while waiting:
            for state in into.get(waiting.pop(), ()):
                if state not in found:
                    found.add(state)
                    waiting.append(state)
        return found


def _leads(state: State) -> Iterator[tuple[str, frozenset[State]]]:
    for event in Event:
        if can_happen(event, state):
            yield event.name, after(event, state)
    yield TIME, all_plain(frozenset(passes(state)))
    yield PEOPLE, all_plain(frozenset(others_do(state)))
