"""The end of the demonstration: the table, the verdict, the picture."""

import math
from pathlib import Path

from rich.console import Console
from rich.table import Table

from rover_sim.demo.third_party import ACCEPTED, ORDER, STATES, TASK_MOVE, Place, Seen, ThirdParty

MOVE_TOLERANCE = 0.05  # m; the rover's own estimate is off by 2 to 4 cm
TURN_TOLERANCE = 1.0  # deg


def measured(task: Seen) -> float:
    """Return the metres driven along the first heading, or the degrees turned; NaN if unknown."""
    began, ended = task.began, task.ended
    if began is None or ended is None:
        return math.nan
    if task.leg.command == TASK_MOVE:
        return (ended.north - began.north) * math.cos(began.yaw) + (
            ended.east - began.east
        ) * math.sin(began.yaw)
    return math.degrees(math.remainder(ended.yaw - began.yaw, math.tau))


def problems(party: ThirdParty) -> list[str]:
    """Return a description of every deviation from the expected result."""
    found = []
    ids = [task.task_id for task in party.tasks]
    if any(task.result != ACCEPTED for task in party.tasks):
        found.append("a submission was not accepted")
    if len(set(ids)) != len(ids) or 0 in ids:
        found.append(f"task ids {ids} are not three different ones")
    if tuple(party.order) != ORDER:
        found.append(f"order of execution {[ids[i] for i in party.order]}, not {ids}")
    for task in party.tasks:
        label = f"task {task.task_id} ({task.leg.name})"
        if STATES[task.state] != "completed":
            found.append(f"{label} is {STATES[task.state]}, not completed")
        error = abs(measured(task) - task.leg.amount)
        tolerance = MOVE_TOLERANCE if task.leg.command == TASK_MOVE else TURN_TOLERANCE
        if not error <= tolerance:
            found.append(f"{label} is off by {error:.3f} {task.leg.unit}, allowed {tolerance}")
    return found


def print_table(console: Console, party: ThirdParty) -> None:
    """Print one line for each task; measured and error have the unit of what was asked."""
    table = Table(title="What the rover did")
    for heading in ("id", "type", "prio", "order", "state", "time"):
        table.add_column(heading, justify="left" if heading in ("type", "state") else "right")
    for heading in ("asked", "measured", "error"):
        table.add_column(heading, justify="right")
    for index, task in enumerate(party.tasks):
        leg, real = task.leg, measured(task)
        digits = 3 if leg.command == TASK_MOVE else 2
        table.add_row(
            str(task.task_id),
            leg.name,
            str(leg.priority),
            str(party.order.index(index) + 1) if index in party.order else "-",
            STATES[task.state],
            f"{task.execution_time:.1f} s",
            f"{leg.amount:g} {leg.unit}",
            f"{real:.{digits}f}",
            f"{real - leg.amount:+.{digits}f}",
        )
    console.print(table)


def draw(track: list[Place], path: Path) -> None:
    """Write a picture of the driven track, north up; raise ImportError without matplotlib."""
    import matplotlib as mpl  # noqa: PLC0415  (more than a second to import)

    mpl.use("Agg")
    from matplotlib import pyplot  # noqa: PLC0415

    figure, axes = pyplot.subplots(figsize=(6, 6))
    axes.plot([p.east for p in track], [p.north for p in track], linewidth=2)
    start, end = track[0], track[-1]
    axes.plot(start.east, start.north, "o", label="start")
    axes.plot(end.east, end.north, "s", label="end")
    for place in (start, end):
        axes.arrow(
            place.east,
            place.north,
            0.2 * math.sin(place.yaw),
            0.2 * math.cos(place.yaw),
            head_width=0.06,
        )
    axes.set(xlabel="east, m", ylabel="north, m", title="Track of the rover", aspect="equal")
    axes.margins(0.2)
    axes.grid(visible=True, alpha=0.3)
    axes.legend()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=120)
    pyplot.close(figure)
