"""Draw the lifecycle table into mav_tasks/README.md; `--check` reports whether it is outdated."""

import sys

from generated import keep_current
from mav_tasks.tasks.lifecycle import INITIAL, TERMINAL, TRANSITIONS, TaskState


def diagram() -> str:
    """Return the table as a Mermaid state diagram, with one line for the transitions to KILLED."""
    lines = ["```mermaid", "stateDiagram-v2"]
    lines += [f"    [*] --> {_name(state)}" for state in sorted(INITIAL)]
    for old, edges in TRANSITIONS.items():
        lines += [
            f"    {_name(old)} --> {_name(new)}: {why}"
            for new, why in edges.items()
            if new is not TaskState.KILLED
        ]
    killable = ", ".join(
        _name(old) for old, edges in TRANSITIONS.items() if TaskState.KILLED in edges
    )
    lines += [f"    {_name(state)} --> [*]" for state in sorted(TERMINAL)]
    lines += ["```", "", f"`killed` (STOP or kill) is reached from: {killable}.", ""]
    return "\n".join(lines)


def _name(state: TaskState) -> str:
    return state.name.lower()


if __name__ == "__main__":
    sys.exit(keep_current("mav_tasks/README.md", "state diagram", "state_diagram.py", diagram()))
