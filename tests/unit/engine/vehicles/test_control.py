"""The table of joint control, in every state that it leads to: what holds a vehicle holds it.

It stands below the seams: no run of the server comes to all states, and the table is the proof.
"""

from collections.abc import Callable, Iterable, Iterator
from random import Random

import pytest

from mav_tasks.engine.vehicles.control import (
    STANDS,
    TABLE,
    Driver,
    Effect,
    Event,
    Grip,
    Queue,
    State,
    Step,
    Work,
    effects_of,
)
from rover_sim.personas import Persona
from tests.kit.joint.agreement import Agreement, deeds
from tests.kit.joint.graph import PEOPLE, TIME, Graph, variants
from tests.kit.joint.model import MAKES
from tests.kit.px4 import PROMPT_PX4
from tests.kit.world import PROMPT, World

#: the graph takes half a minute, and as much longer as the machine is busy
pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]  # every reachable state is walked


E, F = Event, Effect
#: words after which nothing moves it, whatever is so
WORDS = (E.STOP, E.HOLD, E.PAUSE, E.DISARM, E.EMERGENCY_STOP, E.CLEAR)
#: what is seen, after which no task that had it moves it
SEEN = (
    *(E.TAKEN, E.MODE, E.LAPSED, E.DISARMED, E.PARKED, E.STICK, E.DRIVEN_BY_HAND),
    *(E.LATE, E.TOO_FAST, E.NOT_STANDING),
)

STAND = {F.BRAKE, F.HOLD_AT_ONCE, F.LET_GO, F.STEP, F.ZERO, F.ZERO_KEPT, F.ZERO_AND_HOLD}
MOVES = (Grip.TAKING, Grip.DRIVING)
HAS_IT = (Work.RUNS, Work.ENDS, Work.LOST, Work.STANDS, Work.TAKEN)


RULES: list[Callable[[Graph], None]] = []


def rule(holds: Callable[[Graph], None]) -> Callable[[Graph], None]:
    """Check this of the states of each make."""
    RULES.append(holds)
    return holds


@pytest.mark.parametrize("make", MAKES)
def test_each_rule_holds_in_every_state(make: str) -> None:
    """One test, as the graph takes its time."""
    graph = Graph(make)
    assert len(graph.paths) > 1000
    for holds in RULES:
        holds(graph)


def moves(state: State) -> bool:
    """Whether a task drives it, or begins to."""
    return state.work is Work.RUNS and state.grip in MOVES


def all_effects(event: Event, state: State) -> Iterator[Effect]:
    """Yield what is done, in one of the ways that it can go."""
    yield from flat(effects_of(event, state), state)


def told(graph: Graph, event: Event, state: State, there: State) -> str:
    """Return what went wrong, in words."""
    return f"{event.name} in {state} after {graph.paths[state]}: {there}"


def flat(steps: Iterable[Step], state: State) -> Iterator[Effect]:
    for step in steps:
        if isinstance(step, Event):
            yield from flat(effects_of(step, state), state)
        else:
            yield step


@rule
def after_a_word_that_lets_it_stand_nothing_moves_or_arms_it(graph: Graph) -> None:
    driven = graph.leading_to(moves, TIME)
    led = graph.leading_to(lambda state: state.driver is Driver.CLIENT, TIME)
    armed = graph.leading_to(lambda state: state.armed, TIME)
    # nothing waits after CLEAR, which the graph does not know of
    emptied = graph.leading_to(
        lambda state: moves(state) or state.armed,
        TIME,
        within=lambda state: state.work is not Work.WAITS,
    )
    for state, ways in graph.leads.items():
        for event in WORDS:
            for there in ways[event.name]:
                if event in (E.DISARM, E.EMERGENCY_STOP):
                    there = there._replace(armed=False)  # as the vehicle does
                if event is E.CLEAR and there.work is Work.WAITS:
                    there = there._replace(work=Work.NONE)
                stands = there not in led or there.driver is Driver.CLIENT
                if event is E.CLEAR:
                    stands &= there not in emptied or there.armed
                else:
                    stands &= there not in driven and (there not in armed or there.armed)
                assert stands, told(graph, event, state, there)


@rule
def after_what_is_seen_no_task_that_had_it_goes_on(graph: Graph) -> None:
    driven = graph.leading_to(moves, TIME)
    for state, ways in graph.leads.items():
        for event in SEEN if state.work in HAS_IT else ():
            if event is E.STICK and state.grip not in MOVES:
                continue  # it is nothing to us as long as we do not drive
            for there in ways.get(event.name, ()):
                is_over = there.work in (Work.NONE, Work.WAITS)  # what was being cancelled
                assert there not in driven or is_over, told(graph, event, state, there)


@rule
def who_stopped_it_is_let_go_by_a_continue_only(graph: Graph) -> None:
    for state, ways in graph.leads.items():
        if state.queue is Queue.STOPPED:
            for name, states in ways.items():
                is_left = any(there.queue is not Queue.STOPPED for there in states)
                assert not is_left or name == E.CONTINUE.name, (name, state)


@rule
def what_somebody_disarmed_is_armed_after_a_word_only(graph: Graph) -> None:
    armed = graph.leading_to(lambda state: state.armed, TIME)
    for state, ways in graph.leads.items():
        if not state.may_arm:
            allowed = {name for name, states in ways.items() if any(s.may_arm for s in states)}
            assert allowed <= {E.CONTINUE.name, E.RESTORE.name}
            assert state.armed or state not in armed, state


@rule
def each_halt_has_a_way_to_stand_where_we_have_it(graph: Graph) -> None:
    for state, ways in graph.leads.items():
        for event in (*WORDS, *SEEN) if state.grip in MOVES else ():
            if event.name not in ways or event is E.PARKED:  # it stands, in HOLD
                continue
            for each in variants(event, state):
                done = set(all_effects(event, each))
                is_of_others = F.LOSE in done and event not in WORDS
                stands = event is E.STICK and state.work in STANDS  # it is being stopped
                assert done & STAND or is_of_others or stands, f"{event.name} in {each}"


@rule
def no_two_move_it(graph: Graph) -> None:
    for state, path in graph.paths.items():
        assert not (moves(state) and state.driver is Driver.CLIENT), (state, path)


@rule
def each_state_has_a_way_out(graph: Graph) -> None:
    """Cleared, HOLD, continued and a while later it is free, and may be armed."""

    def is_free(state: State) -> bool:
        rests = (state.queue, state.grip, state.work) == (Queue.RUNS, Grip.FREE, Work.NONE)
        return rests and state.may_arm and not state.is_led

    ways = (E.CLEAR.name, E.HOLD.name, E.CONTINUE.name, TIME, PEOPLE)
    assert set(graph.paths) == graph.leading_to(is_free, *ways)


def rows_for(make: State) -> Iterator[int]:
    """Yield the numbers of the rows that can apply: some are for the other make alone."""
    decided = set[Event]()
    of_make = MAKES["PX4"].keys()
    for number, row in enumerate(TABLE):
        asked = row.where.keys() & of_make
        if row.event not in decided and all(
            getattr(make, name) in row.where[name] for name in asked
        ):
            yield number
            if row.where.keys() <= of_make:
                decided.add(row.event)


@rule
def each_row_is_about_something_that_happens(graph: Graph) -> None:
    unused = set(rows_for(next(iter(graph.paths))))
    rows = {event: [i for i, row in enumerate(TABLE) if row.event is event] for event in Event}
    for state, ways in graph.leads.items():
        for event in Event if unused else ():
            if event in (E.CLOSE, E.LEAVE) or event.name in ways:
                for each in variants(event, state) if unused & set(rows[event]) else ():
                    unused.discard(next(i for i in rows[event] if TABLE[i].fits(each)))
    assert [TABLE[i] for i in unused] == []


@pytest.mark.parametrize("persona", [PROMPT, PROMPT_PX4], ids=lambda each: each.name)
def test_the_server_does_what_the_graph_is_made_of(
    persona: Persona, monkeypatch: pytest.MonkeyPatch
) -> None:
    agreement, random = Agreement(), Random(0)
    agreement.look_on(monkeypatch)
    world = World(persona=persona).ready()
    possible = deeds(world)
    for _ in range(120):
        random.choice(possible)()
        world.run(random.choice((0.3, 1.5, 4.0)))
    assert agreement.compared > 50
    assert agreement.surprises == []
