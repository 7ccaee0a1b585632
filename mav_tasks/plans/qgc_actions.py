"""QGroundControl's actions files: buttons of its fly view that send a command.

QGroundControl 5 reads "MavlinkActions", 4.3 and 4.4 read "CustomActions"; the contents are the
same. A button cannot prompt for numbers, and JSON has no NaN, so each action has all seven
parameters.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from mav_tasks.basics.errors import UsageError
from mav_tasks.basics.whole_file import write_whole
from mav_tasks.mavlink.enums import MavCmd, MavComponent

#: file types, each also the name of the folder in which QGroundControl looks for such a file
MAVLINK_ACTIONS, CUSTOM_ACTIONS = "MavlinkActions", "CustomActions"
FILE_TYPES = (MAVLINK_ACTIONS, CUSTOM_ACTIONS)
PROGRAM, DAILY = "QGroundControl", "QGroundControl Daily"  # folders; that of a daily build
FILE_NAME = "mav-tasks.json"
PRIORITY = 5.0  # an omitted parameter is 0, which is the lowest priority
MAX_COMMAND = 0xFFFF


@dataclass(frozen=True, slots=True)
class Action:
    """One button: its label and description, and the command with its parameters."""

    label: str
    description: str
    command: int
    params: tuple[float, ...]


def _task(label: str, description: str, command: MavCmd, *params: float) -> Action:
    first = (*params, 0.0, 0.0, 0.0)[:3]
    return Action(label, description, command, (*first, 0.0, 0.0, 0.0, PRIORITY))


#: QGroundControl shows three in a row, the others after dragging it. In front it puts up to two of
#: its own while a rover is armed, one without an unfinished mission: STOP is always visible, and
#: the buttons for which it has none of its own come next (its mode menu has Hold)
ACTIONS = (
    Action("STOP", "Stop at once; Continue ends it", MavCmd.TASK_STOP, (0.0,)),
    Action("Continue", "Resume task and queue; ends a STOP", MavCmd.DO_PAUSE_CONTINUE, (1.0,)),
    Action("Held: remainder", "Finish the held task", MavCmd.TASK_RELEASE, (0.0, 1.0)),
    Action("Held: skip", "Skip the held task", MavCmd.TASK_RELEASE, (0.0, 2.0)),
    Action("Held: again", "Restart the held task here", MavCmd.TASK_RELEASE, (0.0, 0.0)),
    Action("Pause", "Pause task and queue", MavCmd.DO_PAUSE_CONTINUE, (0.0,)),
    Action("Cancel task", "Cancel the running task", MavCmd.TASK_CANCEL, (0.0,)),
    Action("Clear queue", "Cancel all waiting tasks", MavCmd.TASK_CLEAR, (0.0,)),
    _task("Forward 1 m", "Queue: drive 1 m ahead", MavCmd.TASK_MOVE, 1.0),
    _task("Back 1 m", "Queue: drive 1 m backwards", MavCmd.TASK_MOVE, -1.0),
    _task("Right 90", "Queue: turn 90 degrees clockwise on the spot", MavCmd.TASK_ROTATE, 90.0),
    _task("Left 90", "Queue: turn 90 degrees anticlockwise", MavCmd.TASK_ROTATE, -90.0),
)


def parse_action(text: str) -> Action:
    """Parse ``LABEL=COMMAND,param1,...,param7``; raise UsageError if it is malformed.

    Omitted parameters are 0; an omitted priority of a task command is PRIORITY.
    """
    label, equals, rest = text.partition("=")
    command, *given = rest.split(",")
    if not label or not equals or not command.isdecimal() or not 0 < int(command) <= MAX_COMMAND:
        raise UsageError(f"--action {text}: expected LABEL=COMMAND,param1,...,param7")
    try:
        params = [float(value) for value in given]
    except ValueError as error:
        raise UsageError(
            f"--action {text}: {str(error).rpartition(': ')[2]} is not a number"
        ) from error
    if len(params) > 7 or not all(abs(value) < float("inf") for value in params):
        raise UsageError(f"--action {text}: expected at most seven finite parameters")
    is_task = int(command) in (MavCmd.TASK_MOVE, MavCmd.TASK_ROTATE, MavCmd.TASK_DRIVE)
    if is_task and len(params) < 7:
        params = [*(params + [0.0] * 6)[:6], PRIORITY]
    return Action(label, f"Command {command}", int(command), tuple(params))


def file_of(
    actions: Sequence[Action],
    *,
    file_type: str = MAVLINK_ACTIONS,
    component: int = MavComponent.ONBOARD_COMPUTER,
) -> str:
    entries = [
        {
            "label": action.label,
            "description": action.description,
            "mavCmd": int(action.command),
            "compId": int(component),
            **{
                f"param{number}": value
                for number, value in enumerate((*action.params, *[0.0] * 7)[:7], 1)
            },
        }
        for action in actions
    ]
    file = {"version": 1, "fileType": file_type, "actions": entries}
    return json.dumps(file, indent=2) + "\n"


def install(documents: Path, actions: Sequence[Action], *, component: int) -> list[Path]:
    """Write both files to QGroundControl's folders below ``documents``; return their paths.

    Raise UsageError if one cannot be written.
    """
    written = []
    programs = (PROGRAM, DAILY) if (documents / DAILY).is_dir() else (PROGRAM,)
    for program, file_type in product(programs, FILE_TYPES):
        path = documents / program / file_type / FILE_NAME
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(path, file_of(actions, file_type=file_type, component=component))
        except OSError as error:
            raise UsageError(f"{path}: {error.strerror}") from error
        written.append(path)
    return written
