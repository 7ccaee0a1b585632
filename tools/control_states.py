"""Try every event in every reachable state of control, and check the server's reaction.

    tools/control_states.py --persona px4 --most 1000      takes about a second per state
    tools/control_states.py --start "task, pause"          begins after these events

Exit code 0: no fault; 1: a fault, and its sequence of events is printed. Linux only.
"""

import argparse
import logging
import sys
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "sim")]

from tests.kit.joint.deeds import BY_NAME  # noqa: E402
from tests.kit.joint.search import search  # noqa: E402
from tests.kit.px4 import PROMPT_PX4  # noqa: E402
from tests.kit.world import PROMPT, World  # noqa: E402

PERSONAS = {"ardupilot": PROMPT, "px4": PROMPT_PX4}


def main() -> int:
    """Run the search; return the exit code."""
    parser = argparse.ArgumentParser(
        prog="tools/control_states.py",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--persona", choices=PERSONAS, default="ardupilot")
    parser.add_argument(
        "--most", type=int, default=300, metavar="N", help="explore at most this many states"
    )
    parser.add_argument("--start", default="", metavar="DEEDS", help="events before the search")
    arguments = parser.parse_args()
    start = [name.strip() for name in arguments.start.split(",") if name.strip()]
    if unknown := [name for name in start if name not in BY_NAME]:
        parser.error(f"{unknown[0]}: no deed; there are {', '.join(BY_NAME)}")
    logging.disable(logging.CRITICAL)  # thousands of logged refusals
    make = partial(_world, arguments.persona)
    found = search(make, most=arguments.most, start=start)
    for path, what in found.wrong:
        print(f"{', '.join(path)}: {what}")
    print(found)
    return 1 if found.wrong else 0


def _world(persona: str) -> World:
    return World(persona=PERSONAS[persona]).ready()


if __name__ == "__main__":
    sys.exit(main())
