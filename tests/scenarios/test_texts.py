"""What people at ground stations read, and what TASK_STATUS says of who submitted."""

import re

from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.cases import for_each
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

INFO, NOTICE, WARNING, ERROR = 6, 5, 4, 3
TEXTS = 300


def test_what_is_too_much_at_once_is_counted_and_nothing_urgent_is_left_out(
    make_world: MakeWorld,
) -> None:
    world = make_world()
    listener = world.add_client("listener", system_id=254)
    world.run(1)
    listener.received.clear()
    for number in range(TEXTS):
        world.client.command(54000, 1.0, 0, 0, number + 1, 0, 500.0, 5)
        if number % 50 == 0:
            world.client.command(54000, float("nan"))  # refused, and said to who asked
        world.run(0.01)
    world.run(3)
    texts = listener.texts()
    queued = [text for text in texts if re.fullmatch(r"Task \d+ queued: move 1 m", text)]
    left_out = [
        int(found[1]) for text in texts if (found := re.match(r"(\d+) messages dropped", text))
    ]
    assert 10 <= len(queued) < 100
    assert len(queued) + sum(left_out) == TEXTS
    assert len(texts) == len(queued) + len(left_out)
    refused = [text for text in world.client.texts() if "not given" in text]
    assert len(refused) == TEXTS // 50


def test_each_change_has_its_severity(world: World) -> None:
    world.client.move(1)
    world.client.command(54000, 1.0, 0, 0, 9, 0, 0, 5, repeats=(0.0,))
    world.until_idle(tasks=2)
    world.client.command(54000, 1.0, 0, 0, 0, 0, 500.0, 5)
    world.client.command(54012, 3, 3, 0.2)  # a deadline
    world.until_state(3, S.EXPIRED)
    world.run(0.2)
    said = {m.text: m.severity for m in world.client.of_type("STATUSTEXT")}
    assert said["Task 1 queued: move 1 m"] == INFO
    assert said["Task 1 started"] == INFO
    assert said["Task 1 done"] == INFO
    assert next(s for text, s in said.items() if text.startswith("Task 3 expired")) == ERROR
    assert not any(text.endswith("\t") for text in said)


def severities(world: World) -> dict[str, int]:
    """Return what the task server has said, with the severity of each."""
    return {m.text: m.severity for m in world.client.of_type("STATUSTEXT")}


def test_what_went_as_asked_is_no_warning(world: World) -> None:
    world.client.move(2)
    world.until_state(1, S.EXECUTING)
    world.client.move(1, nonce=2)
    world.client.pause()
    world.run(3)
    world.client.proceed()
    world.run(3)
    world.client.command(54010, 1)
    world.until_idle(tasks=2)
    world.run(0.2)
    said = severities(world)
    assert {
        "Task 1 paused by a ground station",
        "Queue paused by a ground station",
        "Queue resumed by a ground station: task 1 is next,",
    } <= set(said)
    assert {"Task 1 cancelled", "Task 2 done", "Rover 1 found (ardupilot)"} <= set(said)
    assert set(said.values()) == {INFO}


def test_who_only_listens_hears_of_the_end_however_long_it_takes(world: World) -> None:
    quiet = world.add_client("quiet")
    quiet.heartbeats = False
    quiet.move(40, speed=0.5)
    world.until_state(1, S.COMPLETED, within=200)
    world.run(0.2)
    assert world.now > 70
    assert quiet.statuses(1)[-1].state == S.COMPLETED
    world.run(90)
    assert not any("quiet" in who for who in world.server.engine.snapshot(now=world.now).clients)


@for_each("how, why", [("pause", "queue paused"), ("stop", "STOP in force")])
def test_who_queues_behind_a_pause_is_told_that_nothing_runs(
    world: World, how: str, why: str
) -> None:
    getattr(world.client, how)()
    world.run(1)
    other = world.add_client("other")
    world.run(1.2)
    other.move(1)
    world.run(0.2)
    assert f"Task 1 waits, press Continue ({why}): move 1 m" in other.texts()
