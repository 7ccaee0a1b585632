"""The report of a failing test: seed, rovers, tasks, events and texts."""

from mav_tasks.tasks.lifecycle import words_of
from mav_tasks.tasks.task import Task
from rover_sim.testing.rover_world import RoverWorld

LAST_TASKS, LAST_EVENTS, LAST_TEXTS = 8, 12, 8


def describe_world(world: RoverWorld) -> str:
    """Return the state of the world in lines."""
    options = world.options
    kind = f"{options.persona}, {options.body} body"
    lines = [
        f"seed {world.seed} (the same again: --rover-seed {world.seed})",
        f"{kind}, {world.now:.2f} s of virtual time",
        *map(repr, world.rovers),
    ]
    lines += _part("tasks", [_line_of(task) for task in world.server.tasks[-LAST_TASKS:]])
    events = [f"{event.at:9.2f} s  {event}" for event in world.server.events[-LAST_EVENTS:]]
    lines += _part("journal", events)
    lines += _part("texts", [str(text) for text in world.texts[-LAST_TEXTS:]])
    return "\n".join(lines)


def _line_of(task: Task) -> str:
    why = f" ({words_of(task.reason)})" if task.reason else ""
    state = task.state.name.lower()
    return f"{task.id:6} of rover {task.vehicle}: {task.goal.words}: {state}{why}"


def _part(title: str, lines: list[str]) -> list[str]:
    return [f"{title}:", *lines] if lines else []
