"""A kind of task from outside the package: face away from a dock, back in, switch the charger on.

``pip install .`` where mav-tasks is installs it, with this in a pyproject.toml beside it:

    [project]
    name = "dock"
    version = "0.1"
    [project.entry-points."mav_tasks.kinds"]
    dock = "dock:FORM"

Then there is ``mav-tasks submit dock 90 0.5``, a goal "dock" in the HTTP API and for agents, and
its form on the web page.
"""

from mav_tasks import Act, Face, Move
from mav_tasks.config.setting_keys.parts import Part
from mav_tasks.config.setting_keys.shapes import Number
from mav_tasks.kinds.form import HEADING, Form, any_number

DEGREE = 0.017453292519943295  # rad
SLOW = 0.2  # m/s
RELAY = 181  # DO_SET_RELAY


def dock(heading: float, depth: float, relay: int | None) -> tuple[Face | Move | Act, ...]:
    """Return the goals that dock a rover, in their order."""
    charger = (float(relay or 0), 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return Face(heading), Move(-depth, SLOW), Act(RELAY, charger)


FORM = Form(
    "dock",
    "Dock",
    "Face away from the dock, back in, and switch the charger on.",
    (
        Part("heading", any_number("deg", DEGREE), f"away from the dock: {HEADING}", True),
        Part("depth", Number(0.05, 3.0, "m"), "how far to back in", True),
        Part("relay", Number(0, 15, is_whole=True), "relay of the charger; 0 if not given"),
    ),
    dock,
)
