"""Tasks for any rover: which one the server chooses, what it says, and when it chooses again."""

from pathlib import Path
from typing import Any

from mav_tasks.config.settings import Settings
from mav_tasks.tasks.events import SubmissionRefused, TaskAssigned, TaskSubmitted
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import Faults
from rover_sim.geo import DEFAULT_ORIGIN
from rover_sim.personas import Mode
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, ACK, DENIED, MOVE, TEMPORARILY_REJECTED, Sent
from tests.kit.mission import Item, Upload
from tests.kit.restarts import UTC, restart
from tests.kit.rows import ask
from tests.kit.store import PromptSqliteStore
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

GRACE = 5.0  # s, in which a rover that is lost keeps its tasks

ANY = (250, 191)
LOST = 3.5  # s; see Watch.heartbeat_lost
WAYPOINT, OPTIONS = 16, 54014


def submit(world: World, metres: float = 0.5, **kw: Any) -> Sent:
    """Submit a move for any rover."""
    sent = world.client.move(metres, target=ANY, **kw)
    world.run(0.1)
    return sent


def go_to(world: World, north: float, east: float, *, nonce: int = 0) -> Upload:
    """Upload a plan of one place for any rover."""
    x, y = DEFAULT_ORIGIN.to_global(north, east)
    items = [Item(WAYPOINT, x, y, param1=0.01, param4=0.0)]
    items += [Item(OPTIONS, nonce, 0, 5.0, 0.0, 0.0, 0.0, frame=2)] if nonce else []
    return world.upload(items, target=ANY)


def rover_in(sent: Sent) -> int:
    """Return the rover that an ack names."""
    assert sent.ack is not None, "not acknowledged"
    return int(sent.ack.progress)


def rover_of(world: World, task_id: int) -> int:
    return world.task(task_id).vehicle


def test_the_ack_and_the_status_say_which_rover_was_chosen(make_world: MakeWorld) -> None:
    world = make_world(rovers=2)
    sent = submit(world, nonce=7)
    assert sent.answer == (ACCEPTED, 1)
    ack = list(world.client.of_id(ACK))[-1]
    assert (ack.source, rover_in(sent)) == (ANY, 1)
    status = next(p for p in world.client.of_id(54000))
    assert status.source == (1, 191)
    assert "Task 1 queued: move 0.5 m. Rover 1 chosen: free, battery 100%" in "".join(
        world.client.texts()
    )
    world.until_state(1, S.COMPLETED)


def test_the_nearest_free_rover_goes_to_a_place(make_world: MakeWorld) -> None:
    world = make_world(rovers=3)  # at 0, 3 and 6 m east
    upload = go_to(world, 0.0, 5.0)
    assert (upload.result, rover_of(world, upload.opaque_id)) == (0, 3)
    (event,) = world.events(TaskAssigned)
    assert event.choice.startswith("free, 1 m away")
    world.until_state(upload.opaque_id, S.COMPLETED)
    assert abs(world.rovers[2].truth.east - 5.0) < 0.1


def test_a_refusal_names_why_each_rover_cannot(make_world: MakeWorld) -> None:
    world = make_world(rovers=3)
    world.client.stop(target=(1, 191))
    world.client.pause(target=(2, 191))
    world.rovers[2].autopilot.set_faults(Faults(battery=12))
    world.run(2.0)
    sent = submit(world)
    assert sent.answer == (TEMPORARILY_REJECTED, R.STOPPED)
    (event,) = world.events(SubmissionRefused)
    assert event.text == (
        "no rover can: rover 1: STOP in force; rover 2: queue paused (operator);"
        " rover 3: battery 12%, less than 20%"
    )
    assert event.vehicle == 0
    assert event.text in "".join(world.client.texts())
    plan = go_to(world, 0.0, 1.0)
    assert plan.result != 0
    assert len(world.events(SubmissionRefused)) == 2


def test_places_that_depend_on_the_rover_are_refused(make_world: MakeWorld) -> None:
    world = make_world(rovers=2)
    local = world.client.command_int(WAYPOINT, x=1000, y=0, frame=1, target=ANY)
    home = Upload(world.client, [Item(20)], target=ANY)
    world.run(1.0)
    assert local.answer == (DENIED, R.BAD_FRAME)
    assert home.result == 5  # MAV_MISSION_INVALID
    assert not world.events(TaskSubmitted)


# choosing again


def queued_behind(world: World, rover: int) -> int:
    """Let a rover drive for long, and put a task for any rover behind that; return its id."""
    for each in range(1, len(world.rovers) + 1):
        metres = 3.0 if each == rover else 10.0
        world.client.move(metres, nonce=1000 + each, target=(each, 191))
    world.run(2.0)
    task = submit(world, 0.5, nonce=9).task_id
    assert rover_of(world, task) == rover
    return task


def test_a_lost_rover_loses_the_task_that_it_has_not_begun(make_world: MakeWorld) -> None:
    world = make_world(rovers=3)
    task = queued_behind(world, 2)
    world.rovers[1].autopilot.set_faults(Faults(silent=True))
    lost_at = world.now
    world.until(lambda: rover_of(world, task) != 2, within=15)
    assert LOST + GRACE - 1.1 < world.now - lost_at < LOST + GRACE + 2.2
    (*_, event) = world.events(TaskAssigned)
    assert (event.before, event.version) == (2, 2)
    assert event.choice.startswith("rover 2: silent; free in ")
    assert world.client.said(f"is now rover {event.vehicle}'s: rover 2: silent")
    world.until_state(task, S.COMPLETED, within=60)
    again = submit(world, 0.5, nonce=9)
    assert again.task_id == task  # whichever rover it went to
    assert rover_in(again) == event.vehicle


def failsafe_of_rover_2(world: World) -> int:
    """Let rover 2 stop by its own failsafe before a task of any rover; return the task's id."""
    task = queued_behind(world, 2)
    world.rovers[1].autopilot.set_faults(Faults(gps_lost=True))
    second = 1
    world.until(
        lambda: world.server.engine.snapshot(now=world.now).vehicles[second].paused is R.FAILSAFE,
        within=10,
    )
    return task


def test_a_rover_that_its_own_failsafe_has_stopped_loses_the_task_also_over_a_restart(
    make_world: MakeWorld, path: Path
) -> None:
    world = make_world(rovers=2, store=PromptSqliteStore(path, wall_offset=UTC))
    task = failsafe_of_rover_2(world)
    world.until(lambda: rover_of(world, task) == 1, within=GRACE + 2.2)
    assert world.events(TaskAssigned)[-1].choice.startswith("rover 2: rover's failsafe; ")
    before = world.task(task)
    restart(world, path)
    after = world.task(task)
    assert (after.vehicle, after.choice, after.version) == (1, before.choice, before.version)
    assert submit(world, 0.5, nonce=9).task_id == task


#: by a person, of rover 1
HALTS = f"""
TASK_STOP
DO_PAUSE_CONTINUE 0
DO_SET_MODE 1 4 to=autopilot
COMPONENT_ARM_DISARM 0 to=autopilot
operator {Mode.MANUAL.value}
"""


def submit_later(world: World, delay: float) -> int:
    """Submit a move for any rover that starts after so many seconds; return its id."""
    sent = world.client.command(MOVE, 0.5, 0, 0, 9, 0, delay, 5, target=ANY)
    world.run(0.1)
    return sent.task_id


def server_again(world: World, store: PromptSqliteStore) -> None:
    """End the server in an orderly way, and start another one on its store."""
    world.server.shut_down(now=world.now)
    world.until(lambda: world.server.pump.is_over, within=10)
    world.end_server()
    world.start_server(store, store.load())


@for_each("restarts", [False, True])
@for_each("halt", HALTS.strip().split("\n"))
def test_the_task_of_an_idle_rover_that_a_person_halts_stays(
    make_world: MakeWorld, tmp_path: Any, halt: str, restarts: bool
) -> None:
    store = PromptSqliteStore(tmp_path / "tasks.sqlite3", wall_offset=0.0)
    world = make_world(rovers=2, store=store, settings=Settings(on_restart="continue"))
    world.client.mode(4, target=(1, 1))
    world.run(1.0)
    world.client.arm(True, target=(1, 1))
    world.run(2.0)
    task = submit_later(world, 15.0)
    assert rover_of(world, task) == 1
    ask(world, halt)
    world.run(2.0)
    world.rovers[0].autopilot.set_faults(Faults(silent=True))
    if restarts:
        server_again(world, store)
    world.run(30.0)
    assert rover_of(world, task) == 1
    assert world.rovers[1].truth.north == 0.0


def test_a_task_that_has_begun_never_moves(make_world: MakeWorld) -> None:
    world = make_world(rovers=2)
    task = submit(world, 5.0, nonce=1).task_id
    world.until_state(task, S.EXECUTING)
    world.rovers[0].autopilot.set_faults(Faults(silent=True, deaf=True))
    world.run(30.0)
    assert rover_of(world, task) == 1
    assert len(world.events(TaskAssigned)) == 1
