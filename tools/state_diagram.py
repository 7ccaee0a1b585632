"""Draws the state diagram in README.md from the lifecycle table; `--check` tells if it is old."""

import sys
from pathlib import Path

from mav_tasks.tasks.lifecycle import INITIAL, TERMINAL, TRANSITIONS, TaskState

README = Path(__file__).resolve().parent.parent / "README.md"
BEGIN = "<!-- state diagram: made by tools/state_diagram.py -->\n"
END = "<!-- end of state diagram -->\n"


def diagram() -> str:
    """Give the table as a Mermaid state diagram. KILLED is left to one line: all lead to it."""
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


def main() -> int:
    text = README.read_text(encoding="utf-8")
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        print(f"README.md lacks the lines {BEGIN.strip()} and {END.strip()}")
        return 1
    current = before + begin + diagram() + end + after
    if current == text:
        return 0
    if "--check" in sys.argv[1:]:
        print("README.md: the state diagram is not that of the table; run tools/state_diagram.py")
        return 1
    README.write_text(current, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
