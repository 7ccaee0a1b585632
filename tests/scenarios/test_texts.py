"""What people at ground stations read, and when a client hears of its task's end."""

import re

from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

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
