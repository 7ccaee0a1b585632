"""The effects of the table and of time on states: joint control as a graph.

It models only states, not vehicles. ``tests/kit/joint/agreement.py`` compares it with the real
server.
"""

from collections.abc import Callable, Iterable, Iterator
from functools import cache, partial
from itertools import product
from typing import Any, ClassVar

from mav_tasks.engine.vehicles.control import (
    NOTHING,
    Driver,
    Effect,
    Event,
    Grip,
    Queue,
    State,
    Step,
    Waits,
    Work,
    effects_of,
)

E, F = Event, Effect
#: properties of a PX4 and of an ArduPilot
MAKES: dict[str, dict[str, bool]] = {
    "PX4": {"lingers": True, "has_failsafe": True, "heeds_stick": False},
    "ArduPilot": {"lingers": False, "has_failsafe": False, "heeds_stick": True},
}
#: conditions of rows that the graph leaves open
FREE = ("may_be_armed", "is_idle", "is_stopping", "is_late", "brakes")
NO_TASK = (Work.NONE, Work.WAITS)


class Known(State):
    """A state of which there is one object only: sets and dicts find it by its identity.

    What the model makes of one is another.
    """

    __slots__ = ()
    __eq__ = object.__eq__
    __ne__ = object.__ne__
    __hash__ = object.__hash__

    _all: ClassVar[dict[tuple[Any, ...], "Known"]] = {}

    @classmethod
    def _make(cls, iterable: Iterable[Any]) -> "Known":  # type: ignore[override]
        values = tuple(iterable)
        if (found := cls._all.get(values)) is None:
            found = cls._all[values] = tuple.__new__(cls, values)
        return found


def happens(event: Event, state: State) -> frozenset[State]:
    """Return the states to which an event leads, by the table and by what the event implies."""
    if event in (E.MODE, E.MODE_IN_STOP, E.LATE_MODE):  # HOLD or another mode
        states = {state._replace(is_led=False), state._replace(is_led=True)}
    elif event in (E.LAPSED, E.PARKED):
        states = {state._replace(is_led=False)}
    elif event is E.LATE_ARMING:
        states = {state._replace(armed=True)}
    elif event is E.DISARMED:
        states = {state._replace(armed=False)}
    else:
        return _follow(event, state)
    return frozenset().union(*(_follow(event, each) for each in states))


def _follow(event: Event, state: State) -> frozenset[State]:
    return _chain(event, effects_of(event, state))(state)


@cache
def _chain(
    event: Event, steps: tuple[Step, ...], is_emptied: bool = False
) -> Callable[[State], frozenset[State]]:
    """Return the function from a state to those after the steps, which remembers its results."""
    if not steps:
        return lambda state: frozenset((state,))
    step = steps[0]
    is_emptied |= event is E.CLEAR and step is F.DO
    after = _chain(event, steps[1:], is_emptied)
    if isinstance(step, Event):
        first: Callable[[State], Iterable[State]] = partial(_follow, step)
    else:
        first = DO[event] if step is F.DO else RESULTS.get(step, _same)

    @cache
    def follow(state: State) -> frozenset[State]:
        following = _emptied(first(state)) if is_emptied else first(state)
        return frozenset().union(*map(after, following))

    return follow


def forget() -> None:
    """Forget the remembered results, which take hundreds of megabytes."""
    _chain.cache_clear()


def _emptied(states: Iterable[State]) -> set[State]:
    """Return the states after CLEAR: nothing waits, nothing starts."""
    return {
        state._replace(work=Work.NONE) if state.work is Work.WAITS else state
        for state in states
        if state.work is not Work.RUNS
    }


def _same(state: State) -> Iterator[State]:
    yield state


def _without(waits: Waits) -> Callable[[State], Iterator[State]]:
    return lambda state: iter((state._replace(waits=state.waits & ~waits),))


def _brake(state: State) -> Iterator[State]:
    yield state._replace(grip=Grip.STOPPING)


def _let_go(state: State) -> Iterator[State]:
    yield state._replace(grip=Grip.RELEASING)


def _revoke(state: State) -> Iterator[State]:
    driver = Driver.NOBODY if state.driver is Driver.CLIENT else state.driver
    yield state._replace(waits=state.waits & ~Waits.GRANT, driver=driver)
    if driver is not state.driver:  # another party may have driven, too
        yield state._replace(waits=state.waits & ~Waits.GRANT, driver=Driver.OTHERS)


def _outdate(state: State) -> Iterator[State]:
    """Yield the states after a halt: what was permitted before it counts no more."""
    for each in _revoke(state):
        yield each._replace(waits=NOTHING)


def _count(state: State) -> Iterator[State]:
    """Yield the states after a halt; an immediate task that has not started may wait."""
    is_urgent = state.is_urgent and state.work not in NO_TASK
    for each in _outdate(state):
        counted = each._replace(is_urgent=is_urgent)
        yield counted
        if is_urgent:
            yield counted._replace(is_urgent=False)


def _pause(state: State) -> Iterator[State]:
    queue = Queue.PAUSED if state.queue is Queue.RUNS else state.queue
    for each in _count(state._replace(queue=queue)):
        stands = each.work in (Work.RUNS, Work.LOST)  # a task that is being cancelled ends
        yield each._replace(work=Work.STANDS) if stands else each


def _pause_taken(state: State) -> Iterator[State]:
    queue = state.queue if state.queue is Queue.STOPPED else Queue.TAKEN
    for each in _count(state._replace(queue=queue)):
        if each.work in NO_TASK:
            yield each
            continue
        if each.work is Work.ENDS:  # nothing waits for its standstill
            yield from _over(each)
        elif each.work is Work.RUNS:
            yield each._replace(work=Work.TAKEN)
        else:
            yield each._replace(work=Work.STANDS) if each.work is Work.LOST else each


def _latch(state: State) -> Iterator[State]:
    for each in _outdate(state):
        stopped = each._replace(queue=Queue.STOPPED, is_urgent=False)
        yield stopped._replace(work=Work.NONE)
        if state.work is not Work.NONE:
            yield stopped._replace(work=Work.WAITS)


def _hold_task(state: State) -> Iterator[State]:
    for each in _count(state):
        stands = each.work in (Work.RUNS, Work.LOST, Work.TAKEN)
        yield each._replace(work=Work.STANDS) if stands else each


def _restore(state: State) -> Iterator[State]:
    yield state._replace(may_arm=True)


def _hand_over(state: State) -> Iterator[State]:
    yield state._replace(grip=Grip.FREE) if state.grip is Grip.RELEASING else state


def _keep_armed(state: State) -> Iterator[State]:
    yield state
    yield from _hand_over(state)


def _note_others(state: State) -> Iterator[State]:
    yield state if state.driver is Driver.CLIENT else state._replace(driver=Driver.OTHERS)


def _over(state: State) -> Iterator[State]:
    """Yield the states after the end of the active task; others may wait."""
    ended = state._replace(is_urgent=False)
    yield ended._replace(work=Work.NONE)
    yield ended._replace(work=Work.WAITS)


def _stepped(state: State) -> Iterator[State]:
    """Yield the states after a step of the tasks, in which up to two changes happen."""
    yield state
    for each in passes(state):
        yield each
        yield from passes(each)


def passes(state: State) -> Iterator[State]:
    """Yield the changes that time alone can cause: no request, no person, no failure."""
    work, grip = state.work, state.grip
    can_take = state.armed or state.may_arm
    if state.queue is Queue.STOPPED:
        if grip is not Grip.FREE:
            yield state._replace(grip=Grip.FREE)
            yield state._replace(grip=Grip.STOPPING)
        return
    begins = state.queue is Queue.RUNS or state.is_urgent
    if work is Work.WAITS and begins and can_take and is_free(state):
        yield state._replace(work=Work.RUNS)
        yield state._replace(work=Work.STANDS)  # its position reference changed, or displaced
    if Waits.RELEASE in state.waits:
        released = state._replace(waits=state.waits & ~Waits.RELEASE)
        yield released
        if begins and can_take and is_free(state):
            yield released._replace(work=Work.RUNS)
    if work is Work.ENDS:
        yield from _over(state)
    if work is Work.RUNS:
        if grip is not Grip.DRIVING and can_take:
            yield state._replace(grip=Grip.TAKING)
        if grip is Grip.TAKING and can_take:
            yield state._replace(grip=Grip.DRIVING, armed=True)
        yield from _over(state)
        yield state._replace(work=Work.STANDS)
        yield state._replace(work=Work.LOST)
    elif grip in (Grip.TAKING, Grip.DRIVING, Grip.STOPPING):
        yield state._replace(grip=Grip.RELEASING)
    if grip is Grip.RELEASING:
        yield state._replace(grip=Grip.FREE)
        yield state._replace(grip=Grip.FREE, armed=False)
    if work is Work.LOST:
        yield state._replace(work=Work.STANDS)
        yield from _over(state)
        if is_free(state):  # even if the queue is paused, this task resumes
            yield state._replace(work=Work.RUNS)
    if state.waits & (Waits.GO_TO | Waits.START):
        yield state._replace(waits=state.waits & ~(Waits.GO_TO | Waits.START))
    if state.driver is not Driver.NOBODY:
        yield state._replace(driver=Driver.NOBODY)
    if client_moves(state):
        yield state._replace(driver=Driver.CLIENT)


def client_moves(state: State) -> bool:
    """Return whether a client's setpoints pass; a continuing stream is nothing new."""
    is_free = state.grip is Grip.FREE and state.work in NO_TASK
    runs = state.queue is not Queue.STOPPED
    return Waits.GRANT in state.waits and state.armed and is_free and runs


def others_do(state: State) -> Iterator[State]:
    """Yield people's actions that are no events: a task is submitted, the vehicle is armed."""
    if state.work is Work.NONE:
        yield state._replace(work=Work.WAITS)
    if state.is_led:  # a person who did not drive sets HOLD
        yield state._replace(is_led=False)
    if not state.armed:
        yield state._replace(armed=True)
        if Waits.START in state.waits:
            started = state._replace(armed=True, waits=state.waits & ~Waits.START)
            yield started._replace(work=Work.WAITS if state.work is Work.NONE else state.work)
    else:  # by us or by a client; for others there is an event
        yield state._replace(armed=False)
    if not state.armed and state.lingers and not state.waits & Waits.START:
        yield state._replace(waits=state.waits | Waits.START)


def _goes_on(state: State) -> Iterator[State]:
    going = state._replace(queue=Queue.RUNS)
    if state.work not in (Work.STANDS, Work.TAKEN):
        yield going
        return
    yield going._replace(work=Work.STANDS)  # it is held, or its position reference changed
    if state.is_urgent:  # a mission that was started drives first
        yield going
    if state.driver is Driver.NOBODY:  # a mission goes on out of any mode
        yield going._replace(work=Work.RUNS)


def is_free(state: State) -> bool:
    """Return whether a task can take the vehicle."""
    return state.driver is Driver.NOBODY and not (state.is_led and state.armed)


def _released(state: State) -> Iterator[State]:
    if state.driver is Driver.NOBODY:  # a booting vehicle may be in any mode
        yield state._replace(work=Work.RUNS)
    yield state._replace(work=Work.STANDS, waits=state.waits | Waits.RELEASE)


def _run_now(state: State) -> Iterator[State]:
    yield state  # refused
    immediate = state._replace(is_urgent=True)
    paused = (
        immediate if immediate.queue is not Queue.RUNS else immediate._replace(queue=Queue.PAUSED)
    )
    if state.driver is not Driver.NOBODY:  # a mission waits until nobody else drives
        yield immediate._replace(work=Work.WAITS)
        yield paused._replace(work=Work.WAITS)
        return
    for work in (Work.WAITS, Work.RUNS, *([Work.ENDS] if state.work is Work.RUNS else [])):
        yield immediate._replace(work=work)
        yield paused._replace(work=work)
    yield paused


def _called_off(state: State) -> Iterator[State]:
    for each in _count(state):
        if each.work in NO_TASK:
            yield each
        else:
            yield from _over(each)
            yield from _over(each._replace(grip=Grip.STOPPING))  # killed
            yield each._replace(work=Work.ENDS)


def _ended_by_force(state: State) -> Iterator[State]:
    """Yield the states in which a mission stays, or nothing does; what stays waits."""
    for each in (state, *(() if state.work in NO_TASK else _over(state)), *_unqueued(state)):
        yield each
        if each.work is not Work.NONE and each.queue is Queue.RUNS:
            yield each._replace(queue=Queue.PAUSED)


def _unqueued(state: State) -> Iterator[State]:
    yield state
    if state.work is Work.WAITS:
        yield state._replace(work=Work.NONE)


def _cleared(state: State) -> Iterator[State]:
    for each in _called_off(state):
        yield each._replace(work=Work.NONE) if each.work is Work.WAITS else each


def _skipped(state: State) -> Iterator[State]:
    yield state
    if state.work not in NO_TASK:
        yield from _over(state)


def _restarted(state: State) -> Iterator[State]:
    active = () if state.work in NO_TASK else (Work.STANDS, Work.RUNS)
    kept = state._replace(waits=state.waits & ~Waits.RELEASE)
    for may_arm, is_urgent in product({False, state.may_arm}, {False, state.is_urgent}):
        for work in {state.work, *active}:  # it starts again if it has not driven yet
            each = kept._replace(may_arm=may_arm, is_urgent=is_urgent, work=work)
            yield each
            # one of those that wait may have begun, and is held
            if work is not Work.NONE and each.queue in (Queue.RUNS, Queue.TAKEN):
                yield each._replace(queue=Queue.PAUSED)
            if work not in NO_TASK:
                yield from _over(each)


def _granted(state: State) -> Iterator[State]:
    granted = state._replace(waits=state.waits | Waits.GRANT)
    yield granted
    yield granted._replace(is_led=False)  # it is already in that mode


RESULTS: dict[Effect, Callable[[State], Iterator[State]]] = {
    F.BRAKE: _brake,
    F.HOLD_AT_ONCE: _brake,
    F.LET_GO: _let_go,
    F.STEP: _stepped,
    F.WAKE: _stepped,
    F.REGAIN: lambda state: iter((state._replace(grip=Grip.DRIVING),)),
    F.LOSE: lambda state: iter((state._replace(grip=Grip.FREE),)),
    F.OUTDATE: _outdate,
    F.FORGET_GO_TO: _without(Waits.GO_TO),
    F.FORGET_START: _without(Waits.START),
    F.FORGET_RELEASE: _without(Waits.RELEASE),
    F.REVOKE: _revoke,
    F.COUNT: _count,
    F.PAUSE: _pause,
    F.PAUSE_TAKEN: _pause_taken,
    F.LATCH: _latch,
    F.HOLD_TASK: _hold_task,
    F.WITHDRAW_ARMING: lambda state: iter((state._replace(may_arm=False),)),
    F.RESTORE_ARMING: _restore,
    F.LINGER: lambda state: iter((state._replace(waits=state.waits | Waits.GO_TO),)),
    F.HAND_OVER: _hand_over,
    F.KEEP_ARMED: _keep_armed,
    F.NOTE_OTHERS: _note_others,
}
DO: dict[Event, Callable[[State], Iterator[State]]] = {
    E.CANCEL: _called_off,
    E.EMERGENCY_STOP: _ended_by_force,
    E.CLEAR: _cleared,
    E.SKIP: _skipped,
    E.UNQUEUE: _unqueued,
    E.CLEAR_WAITING: _unqueued,
    E.CONTINUE: _goes_on,
    E.GO_ON: _goes_on,
    E.RELEASE: _released,
    E.RESTORE: _released,
    E.RUN_NOW: _run_now,
    E.ASK_OUR_MODE: _granted,
    E.ASK_OUR_MODE_STREAMING: _granted,
    E.ASK_OTHER_MODE: _same,
    E.ARM: _same,
    E.REBOOTED: _restarted,
}
START = State(waits=NOTHING)
