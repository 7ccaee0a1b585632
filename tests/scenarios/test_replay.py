"""A recorded world is replayed in another process, with other hashes: every event is the same."""

from collections.abc import Callable
from json import loads
from pathlib import Path

from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Clients, Queueing, Settings
from mav_tasks.links.memory import Conditions
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import Faults
from rover_sim.personas import Mode
from tests.kit.cases import for_each
from tests.kit.client import rc_override
from tests.kit.commands import Done, mav_tasks
from tests.kit.mission import Item
from tests.kit.restarts import UTC, restart
from tests.kit.store import LateStore, PromptSqliteStore
from tests.kit.world import World, at
from tests.scenarios.conftest import MakeWorld

HASHES = "12345"  # PYTHONHASHSEED of the other process; this one's is random
RELEASE, AGAIN = 54013, 0
MODIFY, PRIORITY = 54012, 1


def one_rover(make_world: MakeWorld, folder: Path) -> World:
    net = Conditions(delay=0.02, jitter=0.02, loss=0.05, duplication=0.05)
    settings = Settings(clients=Clients(priorities={"255/190": 7}))
    world = make_world(records=folder, conditions=net, settings=settings, seed=3)
    for number, priority in enumerate((3, 8, 5), 1):
        world.client.move(0.3 * number, priority=priority, nonce=number, repeats=(0.0, 0.5, 1.0))
        world.run(0.1)
    world.client.command(MODIFY, 3, PRIORITY, 6)
    world.until(lambda: all(t.state is S.COMPLETED for t in world.tasks()), within=60)
    return world


def any_rover(make_world: MakeWorld, folder: Path) -> World:
    world = make_world(records=folder, rovers=2)
    for number, metres in ((1, 8.0), (2, 4.0)):
        world.client.move(metres, target=(number, 191), nonce=number)
    world.run(2.0)
    for _ in range(2):
        world.client.move(0.5, target=(250, 191), nonce=3)
        world.run(0.5)
    world.client.command_int(16, **at(1.0, 1.0), frame=1, target=(250, 191))
    world.rovers[1].autopilot.set_faults(Faults(silent=True))
    world.until(lambda: world.task(3).vehicle == 1, within=20)
    world.rovers[1].autopilot.set_faults(Faults())
    world.until_state(3, S.COMPLETED, within=60)
    return world


def stop_and_takeover(make_world: MakeWorld, folder: Path) -> World:
    world = make_world(records=folder)
    world.client.move(5)
    world.until_state(1, S.EXECUTING)
    world.client.rotate(90)
    world.run(1)
    world.client.stop()
    world.run(2)
    world.client.proceed()
    world.run(2)
    world.client.send(rc_override(1500, 1500, 1700, 1500))
    world.run(1)
    world.operator_mode(Mode.MANUAL)
    world.run(1)
    world.fault(Faults(silent=True))
    world.run(5)
    return world


def failing_store(make_world: MakeWorld, folder: Path) -> World:
    store = LateStore()
    world = make_world(records=folder, store=store)
    store.delay = 0.2
    world.client.move(0.5)
    world.run(1)
    store.fail("store x: the disk is full")
    world.run(0.1)
    world.client.move(0.5, nonce=9)
    world.until_idle(tasks=1)
    return world


def restarted(make_world: MakeWorld, folder: Path) -> World:
    store = PromptSqliteStore(folder / "tasks.sqlite3", wall_offset=UTC)
    settings = Settings(queueing=Queueing(preemption_gap=3))
    world = make_world(records=folder, store=store, settings=settings)
    world.client.send(common.MAVLink_param_set_message(1, 191, b"TSK_SPEED", 0.4, 9))
    world.upload([Item(16, **at(0.0, 0.0), frame=0), Item(16, **at(1.0, 0.0))])
    world.client.move(2)
    world.run(3)
    world.client.rotate(90, nonce=5)
    world.run(0.5)
    restart(world, folder / "tasks.sqlite3", well=True)
    world.client.command(RELEASE, 2, AGAIN)
    world.run(0.2)
    world.client.proceed()
    world.until(lambda: world.state(3)[0] is S.COMPLETED, within=60)
    world.server.store.close()
    return world


WORLDS: dict[str, Callable[[MakeWorld, Path], World]] = {
    each.__name__: each
    for each in (
        one_rover,
        any_rover,
        stop_and_takeover,
        failing_store,
        restarted,
    )
}


def replayed(path: Path, *options: str) -> Done:
    return mav_tasks("replay", str(path), *options, PYTHONHASHSEED=HASHES)


@for_each("kind", WORLDS)
def test_a_recorded_world_decides_the_same_again(
    make_world: MakeWorld, tmp_path: Path, kind: str
) -> None:
    world = WORLDS[kind](make_world, tmp_path)
    told = [str(event) for event in world.server.store.events]  # type: ignore[attr-defined]
    for path in world.end_records():
        done = replayed(path, "--json")
        *events, verdict = map(loads, done.output.splitlines())
        assert (done.status, verdict["verdict"], done.error) == (0, "same", "")
        assert verdict["why_it_ends"] == "the run is over"
        assert verdict["events"] == len(events) > 0
    assert [event["message"] for event in events] == told
