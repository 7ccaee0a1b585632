"""Every button of the actions file does what is on it."""

import json
from math import pi

from mav_tasks.kinds import Move, Rotate
from mav_tasks.plans.qgc_actions import ACTIONS, file_of
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, Sent
from tests.kit.world import World

BUTTONS = {action["label"]: action for action in json.loads(file_of(ACTIONS))["actions"]}


def press(world: World, label: str) -> Sent:
    """Send what QGroundControl sends, and wait as long as it waits for an answer."""
    action = BUTTONS[label]
    params = [action[f"param{number}"] for number in range(1, 8)]
    sent = world.client.command(action["mavCmd"], *params, target=(1, action["compId"]))
    world.run(1.2)
    assert sent.ack is not None
    return sent


GOALS = {
    "Forward 1 m": Move(1.0),
    "Back 1 m": Move(-1.0),
    "Right 90": Rotate(pi / 2),
    "Left 90": Rotate(-pi / 2),
}


def test_each_task_is_queued_at_the_usual_priority(world: World) -> None:
    for number, (label, goal) in enumerate(GOALS.items(), 1):
        assert press(world, label).answer == (ACCEPTED, number)
        assert (world.task(number).goal, world.task(number).priority) == (goal, 5)
    world.until_idle(tasks=4)


def test_what_runs_is_paused_continued_stopped_and_called_off(world: World) -> None:
    world.client.move(10)
    world.client.rotate(90)
    world.until_state(1, S.EXECUTING)
    press(world, "Pause")
    assert world.state(1) == (S.PAUSED, R.OPERATOR)
    press(world, "Continue")
    world.until_state(1, S.EXECUTING)
    press(world, "Clear queue")
    assert world.state(2) == (S.CANCELLED, R.CLEARED)
    press(world, "Cancel task")
    world.until_state(1, S.CANCELLED)
    press(world, "STOP")
    assert world.paused() is R.STOPPED
    press(world, "Continue")
    assert world.paused() is R.NONE


@for_each(
    "label, ends",
    [("Held: again", S.COMPLETED), ("Held: remainder", S.COMPLETED), ("Held: skip", S.CANCELLED)],
)
def test_a_held_task_is_decided_about(world: World, label: str, ends: S) -> None:
    world.client.move(2)
    world.until_state(1, S.EXECUTING)
    world.run(1)
    world.suspend_server(0.8)
    world.observer.expects_gaps = True
    world.until_state(1, S.HELD)
    world.run(2)
    assert press(world, label).result == ACCEPTED
    world.until_state(1, ends)


def test_none_is_left_untried() -> None:
    assert set(BUTTONS) == GOALS.keys() | {
        "Pause",
        "Continue",
        "Clear queue",
        "Cancel task",
        "STOP",
        "Held: again",
        "Held: remainder",
        "Held: skip",
    }
