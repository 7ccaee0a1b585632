"""What somebody changes about a task stands in the log, with the value before."""

import logging

import pytest

from tests.kit.world import World
from tests.scenarios.test_waiting import (
    DEADLINE,
    MODIFY,
    PREEMPTIBLE,
    PREEMPTIVE,
    PRIORITY,
    RUN_AFTER,
    START_DELAY,
    submit,
)

RUN_BEFORE, EVERY = 11, 9


def test_each_change_is_named(world: World, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    world.client.pause()
    first, task = submit(world), submit(world, 0.3)
    for what, value, words in (
        (PRIORITY, 9, "priority 9 (was 5)"),
        (RUN_AFTER, first, f"runs after task {first}"),
        (RUN_AFTER, 0, "runs after no other task"),
        (RUN_BEFORE, first, "another place in the queue"),
        (PREEMPTIBLE, 0, "not pre-emptible"),
        (PREEMPTIVE, 1, "pre-emptive"),
        (START_DELAY, 60, "start in 60 s"),
        (DEADLINE, 90, "deadline in 90 s"),
        (EVERY, 600, "repeats"),
        (EVERY, 0, "does not repeat"),
    ):
        caplog.clear()
        world.client.command(MODIFY, task, what, value)
        world.run(0.3)
        assert words in caplog.text, (what, value)
        others = [w for w in ("priority", "runs after", "repeat", "deadline") if w not in words]
        assert not any(other in caplog.text for other in others) or what == EVERY, caplog.text
