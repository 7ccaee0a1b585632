"""What a client can put into the store by flooding the server: bytes an hour, whoever it is."""

from collections import deque
from collections.abc import Callable
from itertools import count
from pathlib import Path

from mav_tasks.config.settings import Limits, Roles, Settings
from mav_tasks.tasks.events import TaskModified, VehicleSpeedSet
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, FakeClient, Sent, command_long
from tests.kit.databases import tables
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld
from tests.unit.store.samples import opened

CANCEL, MODIFY, UNKNOWN, CHANGE_SPEED = 54010, 54012, 54049, 178
PRIORITY = 1  # TASK_MODIFY, param2
RATE = 20.0  # requests a second of each role: a tenth of the default
DEFAULT = 200.0
BURST = 6.0  # s, after which a flood has used up what may come at once
MEASURED = 20.0  # s
MB = 1 << 20
OF_A_ROW = 80  # bytes beside its texts, with its entries in indices
_numbers = count(1)
SUBMITTED: deque[Sent] = deque(maxlen=5)


def modify(client: FakeClient) -> None:
    client.send(command_long(MODIFY, 1, PRIORITY, 1 + next(_numbers) % 7))


def submit_and_cancel(client: FakeClient) -> None:
    number = next(_numbers)
    sent = client.move(1.0 + number % 100, nonce=number)
    SUBMITTED.append(sent)
    if SUBMITTED[0].result == ACCEPTED:
        client.send(command_long(CANCEL, SUBMITTED[0].task_id))


def stop_and_resume(client: FakeClient) -> None:
    client.stop()
    client.proceed()


def refused(client: FakeClient) -> None:
    client.send(command_long(54000, float(next(_numbers))))


def unknown(client: FakeClient) -> None:
    client.send(command_long(UNKNOWN, float(next(_numbers))))


#: by flood: the role of its sender, and how many MB an hour it may write at most
FLOODS: dict[Callable[[FakeClient], None], tuple[str, float]] = {
    modify: ("submitter", 20.0),
    submit_and_cancel: ("submitter", 40.0),
    stop_and_resume: ("operator", 40.0),
    refused: ("observer", 5.0),
    unknown: ("operator", 5.0),
}


def flooded(make_world: MakeWorld, flood: Callable[[FakeClient], None], role: str) -> World:
    limits = Limits(rate=RATE)
    roles = Roles(unsigned="safety", addresses={"9/190": role}, submitter=limits, operator=limits)
    world = make_world(settings=Settings(roles=roles))
    client = world.add_client("flood", system_id=9)
    world.run(1.5)
    world.client.pause()
    client.move(1.0)
    world.run(0.5)
    end = world.now + BURST + MEASURED
    while world.now < end:
        flood(client)
        world.run(1.0 / RATE)
    return world


@for_each("flood", FLOODS)
def test_a_flood_writes_so_much_an_hour_and_no_more(
    make_world: MakeWorld, tmp_path: Path, flood: Callable[[FakeClient], None]
) -> None:
    role, most = FLOODS[flood]
    world = flooded(make_world, flood, role)
    since = world.now - MEASURED
    events = [event for event in world.server.store.events if event.at >= since]  # type: ignore[attr-defined]
    path = tmp_path / "flooded.sqlite3"
    with opened(path) as store:
        store.append(events)
    with tables(str(path)) as connection:
        found = connection.execute(
            "SELECT length(body) FROM journal UNION ALL"
            " SELECT length(submitted) + coalesce(length(changed), 0) FROM tasks"
        ).fetchall()
    size = sum(length + OF_A_ROW for (length,) in found)
    # refusals have a limit of their own, which is no part of the role's
    scale = 1.0 if flood in (refused, unknown) else DEFAULT / RATE
    per_hour = size * 3600.0 / MEASURED * scale / MB
    print(f"{flood.__name__}: {len(events)} events, {per_hour:.1f} MB an hour")
    assert per_hour <= most


def test_a_change_that_changes_nothing_is_accepted_and_is_no_event(make_world: MakeWorld) -> None:
    world = make_world()
    world.run(1.5)
    world.client.pause()
    task = world.client.move(1.0)
    world.run(0.5)

    for value, changes in ((7, 1), (7, 1), (3, 2)):
        sent = world.client.command(MODIFY, task.task_id, PRIORITY, value)
        speed = world.client.command(CHANGE_SPEED, 1, 0.1 * value)
        world.run(5.0)
        assert (sent.result, speed.result) == (ACCEPTED, ACCEPTED)
        assert len(world.events(TaskModified)) == changes
        assert len(world.events(VehicleSpeedSet)) == changes
