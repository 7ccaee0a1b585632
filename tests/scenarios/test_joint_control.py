"""Every deed from every state of control that is near: none moves a rover that somebody holds.

All states are more than a test has time for; ``tools/control_states.py`` tries as many as it is
told to.
"""

import sys
from functools import partial

import pytest

from mav_tasks.engine.commands import dispatch, mode_requests
from rover_sim.personas import Persona
from tests.kit.joint.search import search
from tests.kit.px4 import PROMPT_PX4
from tests.kit.world import PROMPT, World

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="forks, and ends with its parent")

MOST = 12  # states from which everything is tried
STARTS = (
    (),
    ("task",),
    ("task", "pause"),
    ("arm", "Guided", "stream on or off"),
    ("task", "restart of the rover"),
)


def world_of(persona: Persona) -> World:
    return World(persona=persona).ready()


@pytest.mark.volume
@pytest.mark.parametrize("start", STARTS, ids=" ".join)
@pytest.mark.parametrize("persona", [PROMPT, PROMPT_PX4], ids=["ardupilot", "px4"])
def test_whatever_happens_in_any_state_what_holds_the_rover_holds(
    persona: Persona, start: tuple[str, ...]
) -> None:
    found = search(partial(world_of, persona), most=MOST, start=start)
    print(found)
    assert found.wrong == []
    assert len(found.states) > 3 * MOST, "hardly anything has happened"


@pytest.mark.patches_core
def test_the_search_finds_a_copy_that_arms_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the rule of order it is found, so that nothing found means something."""
    for module in (dispatch, mode_requests):
        monkeypatch.setattr(module, "require_newer", lambda *_, **__: None)
    start = ("arm", "disarm")
    found = search(partial(world_of, PROMPT), most=1, start=start, way_out=False)
    wrong = {path[-1]: what for path, what in found.wrong}
    assert wrong == {"copy of the last go": "armed though somebody has disarmed it"}
