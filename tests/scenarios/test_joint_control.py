"""Every deed from every state of control that is near: none moves a rover that somebody holds.

All states are more than a test has time for; ``tools/control_states.py`` tries as many as it is
told to.
"""

import re
import subprocess
import sys
from itertools import product
from pathlib import Path

import pytest

from mav_tasks.engine.commands import dispatch, mode_requests
from tests.kit.joint.search import search
from tests.kit.volume import some
from tests.kit.world import PROMPT, World

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="forks, and ends with its parent")

TOOL = Path(__file__).resolve().parents[2] / "tools/control_states.py"
LIMIT = 170  # s for a search that takes ten
MOST = 8  # states from which everything is tried
STARTS = (
    (),
    ("task",),
    ("task", "pause"),
    ("arm", "Guided", "stream on or off"),
    ("task", "restart of the rover"),
)


@pytest.mark.volume
@pytest.mark.timeout(LIMIT + 10)
@pytest.mark.parametrize(
    ("persona", "start"), some([*product(("ardupilot", "px4"), STARTS)], 1, 3, 4, 7, 8)
)
def test_whatever_happens_in_any_state_what_holds_the_rover_holds(
    persona: str, start: tuple[str, ...]
) -> None:
    """In a process of its own: one that holds little is forked sooner."""
    search_of = ("--persona", persona, "--most", str(MOST), "--start", ", ".join(start))
    done = subprocess.run(
        [sys.executable, TOOL, *search_of],
        capture_output=True,
        text=True,
        check=False,
        timeout=LIMIT,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    found = re.search(r"^(\d+) states", done.stdout, flags=re.MULTILINE)
    assert found is not None, done.stdout
    assert int(found[1]) > 3 * MOST, "hardly anything has happened"


def world() -> World:
    return World(persona=PROMPT).ready()


@pytest.mark.patches_core
def test_the_search_finds_a_copy_that_arms_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the rule of order it is found, so that nothing found means something."""
    for module in (dispatch, mode_requests):
        monkeypatch.setattr(module, "require_newer", lambda *_, **__: None)
    start = ("arm", "disarm")
    found = search(world, most=1, start=start, way_out=False)
    wrong = {path[-1]: what for path, what in found.wrong}
    assert wrong == {"copy of the last go": "armed though somebody has disarmed it"}
