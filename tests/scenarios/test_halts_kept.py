"""A halt that was acknowledged holds after a crash, whenever that comes and whatever has kept it.

Each kind of halt, and each moment of a crash, on a server whose queue goes on by itself after a
restart: alone, with a full disk, and as one of two gateways.
"""

from collections.abc import Callable
from math import inf
from pathlib import Path

from mav_tasks.config.settings import Settings
from mav_tasks.tasks.lifecycle import TERMINAL
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, FAILED, MOVE, FakeClient, Sent
from tests.kit.store import LateStore, PromptSqliteStore, write_halts
from tests.kit.world import World, at
from tests.scenarios.conftest import MakeWorld
from tests.scenarios.test_gateways import Fleet

GO_ON = Settings(on_restart="continue")
NOT_KEPT = (FAILED, R.STORE_UNAVAILABLE)
CANCEL, CLEAR, REPOSITION = 54010, 54011, 192
MODIFY, EVERY, ARM, FORCED = 54012, 9, 400, 21196
NAN = float("nan")
HOLD = 4
STARTS_IN = 4.0  # s, of the task that waits
WATCHED = 10.0  # s after the restart


#: what halts a rover that is about to drive task 1: needs the record of halts, or the database
WAITING: dict[str, Callable[[FakeClient], Sent]] = {
    "stop": lambda client: client.stop(),
    "stop all": lambda client: client.stop(target=(0, 0)),
    "stop the server's": lambda client: client.stop(target=(250, 191)),
    "pause": lambda client: client.pause(),
    "pause here": lambda client: client.command(REPOSITION, -1, 1, 0, NAN, NAN, NAN, NAN),
    "hold": lambda client: client.mode(HOLD),
    "disarm": lambda client: client.arm(False),
    "stop and clear": lambda client: client.stop(clear=True),
    "cancel": lambda client: client.command(CANCEL, 1),
    "clear": lambda client: client.command(CLEAR, 0),
}
#: what halts a rover that drives task 1
DRIVING: dict[str, Callable[[FakeClient], Sent]] = {
    "cancel the active": lambda client: client.command(CANCEL, 0),
    "kill": lambda client: client.command(CANCEL, 1, 1),
    "clear all": lambda client: client.command(CLEAR, 1),
}
KINDS = WAITING | DRIVING
IN_DATABASE = ("stop and clear", "cancel", "clear", *DRIVING)  # the record knows no tasks
#: when the crash comes -> delays of the record and of the database, s; s until the crash
MOMENTS = {
    "before the record": (inf, inf, 0.3),
    "under way": (0.2, 0.25, 0.1),
    "after the record": (0.05, inf, 0.3),
    "after the database": (inf, 0.05, 0.3),
    "after both": (0.05, 0.1, 0.3),
    "never kept": (inf, inf, 0.6),
}


def is_kept(kind: str, moment: str) -> bool:
    kept_by_record = moment == "after the record" and kind not in IN_DATABASE
    return kept_by_record or moment in ("after the database", "after both")


def restart(world: World, store: LateStore, path: Path) -> None:
    """Start another server on what the store of a killed one has left."""
    kept, halts = store.left_by_a_crash()
    before = PromptSqliteStore(path, wall_offset=0.0)
    before.append(kept)
    before.take_outcomes()
    before.close()
    write_halts(path, halts, wall_offset=0.0)
    again = PromptSqliteStore(path, wall_offset=0.0)
    world.start_server(again, again.load())


@for_each("moment", MOMENTS)
@for_each("kind", KINDS)
def test_what_was_acknowledged_holds_after_a_crash(
    make_world: MakeWorld, tmp_path: Path, kind: str, moment: str
) -> None:
    store = LateStore()
    world = make_world(store=store, settings=GO_ON)
    if kind in DRIVING:
        world.client.move(20.0)
        world.until_state(1, S.EXECUTING)
        world.run(1.0)
    else:
        world.client.command(MOVE, 1.0, 0, 0, 7, 0, STARTS_IN, 5)
        world.run(0.5)
    store.halts_delay, store.delay, crashes_after = MOMENTS[moment]
    at = world.now
    sent = KINDS[kind](world.client)
    world.run(0.03)
    assert sent.ack is None  # though the rover is halted
    if kind in DRIVING:
        assert "zero" in world.observer.sent_since(at)
    world.run(crashes_after - 0.03)
    if moment == "never kept" or (moment == "after the record" and kind in IN_DATABASE):
        world.run(0.2)
        assert sent.answer == NOT_KEPT
        assert world.client.said("not stored")
    else:
        assert sent.result == (ACCEPTED if is_kept(kind, moment) else None)
    assert len(world.client.acks) == 1 + (sent.ack is not None)

    if sent.result != ACCEPTED and kind != "pause":  # a STOP's observer allows no motion after it
        return
    world.end_server()
    restart(world, store, tmp_path / "tasks.sqlite3")
    world.run(3.0)  # it may brake first
    there = world.truth
    world.run(WATCHED)
    if sent.result == ACCEPTED:
        assert abs(world.truth.north - there.north) < 0.01
        if kind in IN_DATABASE:  # one that has not been seen standing is held
            assert world.state(1)[0] in {*TERMINAL, S.HELD}
    elif moment in ("before the record", "never kept"):
        assert world.truth.north - there.north > 0.5  # nobody had been promised anything


@for_each("then", ["continue", "pause"])
@for_each("halt", ["stop", "emergency stop"])
def test_what_a_stop_has_ended_does_not_come_back(
    make_world: MakeWorld, tmp_path: Path, halt: str, then: str
) -> None:
    store = LateStore()
    world = make_world(store=store, settings=GO_ON)
    world.client.command(MOVE, 1.0, 0, 0, 7, 0, 300.0, 5)
    world.client.command(MODIFY, 1, EVERY, 60)
    world.client.move(20.0)
    world.until_state(2, S.EXECUTING)
    world.client.command_int(REPOSITION, -1, 0, 0, NAN, target=(1, 1), frame=6, **at(0, 4))
    world.run(0.5)
    world.client.pause()
    world.run(2.0)
    assert [state for state, _ in map(world.state, (1, 2, 3))] == [S.SCHEDULED, S.PAUSED, S.QUEUED]
    store.delay = inf
    client = world.client
    is_stop = halt == "stop"
    sent = client.stop() if is_stop else client.command(ARM, 0, FORCED, target=(1, 1))
    world.run(0.5)
    told = client.proceed() if then == "continue" else client.pause()
    world.run(0.5)
    assert (sent.result, told.result) == (ACCEPTED, ACCEPTED)
    world.end_server()
    restart(world, store, tmp_path / "tasks.sqlite3")
    world.run(5.0)
    ends = [S.KILLED if is_stop else S.SCHEDULED, S.KILLED, S.KILLED]
    assert world.states() == ends


def test_a_repeated_halt_is_acknowledged_when_the_first_is_kept(make_world: MakeWorld) -> None:
    store = LateStore()
    world = make_world(store=store)
    store.delay, store.halts_delay = inf, 0.3
    first = world.client.stop()
    world.run(0.05)
    again = world.client.stop()  # counts as the same halt
    world.run(0.2)
    assert (first.ack, again.ack) == (None, None)
    world.run(0.1)
    assert (first.answer, again.answer) == ((ACCEPTED, 0), (ACCEPTED, 0))


@for_each("kind", ["stop", "pause", "hold", "cancel the active"])
def test_copies_of_a_packet_get_one_answer_while_it_waits(make_world: MakeWorld, kind: str) -> None:
    store = LateStore()
    world = make_world(store=store)
    for metres in (20.0, 20.5):
        world.client.move(metres)
    world.until_state(1, S.EXECUTING)
    store.delay = store.halts_delay = 0.2
    before = len(world.client.acks)
    sent: list[bytes] = []
    world.client.on_sent = lambda _message, raw: sent.append(raw)
    KINDS[kind](world.client)
    world.run(0.02)
    for _ in range(3):
        world.client.send_raw(sent[0])
        world.run(0.05)
    world.run(0.5)
    assert len(world.client.acks) == before + 1
    assert world.client.acks[-1].result == ACCEPTED
    assert world.state(2)[0] not in TERMINAL


@for_each("way", ["its own", "another"])
@for_each("kind", WAITING)
def test_a_gateway_acknowledges_what_the_next_one_knows(
    tmp_path: Path, kind: str, way: str
) -> None:
    fleet = Fleet(tmp_path, settings=GO_ON)
    world, first = fleet, fleet.first
    near = fleet.clients[first.name if way == "its own" else fleet.other.name]
    task = fleet.near.command(MOVE, 1.0, 0, 0, 7, 0, STARTS_IN, 5)
    world.run(0.5)
    first.store.is_reached = False
    by_id = kind == "cancel"
    sent = near.command(CANCEL, task.task_id) if by_id else KINDS[kind](near)
    world.run(0.2)
    if "all" not in kind and "server's" not in kind:  # the other gateway answers those, too
        assert sent.ack is None
    first.store.is_reached = True
    world.run(0.05)
    assert sent.result == ACCEPTED
    world.kill(first.name)
    assert world.holder() is fleet.other
    there = world.truth
    world.run(WATCHED)
    assert abs(world.truth.north - there.north) < 0.01
    world.check()
