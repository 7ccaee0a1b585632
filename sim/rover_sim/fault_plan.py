"""Timed faults, as ``--fault`` takes them: parsing only, no rover is touched here.

    [rover 2] at 10 s: block-wheel left for 5 s

``ACTIONS`` lists the faults. A lasting fault lasts for the given time, or for good.
"""

import re
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass
from math import inf, radians

from rover_sim.actuators import output_of, wheels_of
from rover_sim.faults import Faults
from rover_sim.frames import Frame
from rover_sim.vehicle import Vehicle

NUMBER = r"\d+(?:\.\d*)?|\.\d+"  # s, m or deg
FORM = re.compile(
    rf"(?:rover\s+(?P<rover>\d+)\s+)?at\s+(?P<at>{NUMBER})\s*s?\s*:\s*(?P<name>[a-z-]+)"
    rf"(?P<rest>.*?)(?:\s+for\s+(?P<lasts>{NUMBER})\s*s?)?\s*",
    re.IGNORECASE,
)
EXAMPLE = "at 10 s: block-wheel left for 5 s"


class PlanError(Exception):
    """A fault that cannot be parsed; the message is one line for the user."""


#: what happens at once, to a vehicle at a time
Event = Callable[[Vehicle, float], None]


@dataclass(frozen=True, slots=True)
class PlannedFault:
    """One fault with its time."""

    text: str  # as given
    rover: int | None  # system id; None: every rover
    at: float  # s since the simulator started
    event: Faults | Event
    lasts: float = inf  # s


def _push(forward: float, right: float, turn: float = 0.0) -> Event:
    return lambda vehicle, _now: vehicle.push(forward, right, turn)


WAYS = {"forward": (1, 0), "back": (-1, 0), "left": (0, -1), "right": (0, 1)}
#: action name: its syntax for the user, the pattern of its arguments, and what these do on a frame
ACTIONS: Mapping[str, tuple[str, str, Callable[..., Faults | Event]]] = {
    "block-wheel": (
        "block-wheel left|right|all",
        "(left|right|all)",
        lambda _, side: Faults(wheels_blocked=wheels_of(side)),
    ),
    "freeze-output": (
        "freeze-output left|right (ackermann: throttle|steering)",
        r"(\w+)",
        lambda frame, name: Faults(outputs_frozen=frozenset({output_of(name, frame)})),
    ),
    "lose-gps": ("lose-gps", "", lambda _: Faults(gps_lost=True)),
    "breach-fence": ("breach-fence", "", lambda _: Faults(outside_fence=True)),
    "freeze-position": ("freeze-position", "", lambda _: Faults(position_frozen=True)),
    "cut-link": ("cut-link", "", lambda _: Faults(silent=True, deaf=True)),
    "push": (
        "push 0.5 m forward|back|left|right",
        rf"({NUMBER}) ?m ({'|'.join(WAYS)})",
        lambda _, metres, way: _push(*(float(metres) * each for each in WAYS[way])),
    ),
    "turn": (
        "turn 30 deg right|left",
        rf"({NUMBER}) ?deg (right|left)",
        lambda _, degrees, way: _push(0.0, 0.0, radians(float(degrees)) * WAYS[way][1]),
    ),
    "reboot": ("reboot", "", lambda _: lambda vehicle, now: vehicle.autopilot.reboot(now=now)),
    "disarm": (
        "disarm",
        "",
        lambda _: lambda vehicle, now: vehicle.autopilot.operator_arm(False, now=now),
    ),
}
HELP = (
    f"Cause a fault at the given time, for example '{EXAMPLE}'; repeatable."
    f" Faults: {'; '.join(written for written, *_ in ACTIONS.values())}."
    " Prefix 'rover 2' selects one of several rovers; without 'for' the fault is permanent."
)


def read_fault(text: str, frame: Frame, rovers: Container[int]) -> PlannedFault:
    """Parse one fault of rovers with these numbers. Raise PlanError."""
    form = FORM.fullmatch(text.strip())
    if form is None:
        raise PlanError(f"not understood: {text!r}; for example: {EXAMPLE}")
    name = form["name"].lower()
    if name not in ACTIONS:
        raise PlanError(f"unknown fault {name!r} in {text!r}; expected one of {', '.join(ACTIONS)}")
    written, pattern, read = ACTIONS[name]
    rest = re.fullmatch(pattern, " ".join(form["rest"].lower().split()))
    if rest is None:
        raise PlanError(f"{text!r}: write: {written}")
    try:
        event = read(frame, *rest.groups())
    except ValueError as error:
        raise PlanError(f"{text!r}: {error}; write: {written}") from error
    lasts = float(form["lasts"] or inf)
    if form["lasts"] is not None and not isinstance(event, Faults):
        raise PlanError(f"{text!r}: {name} is over at once, leave out 'for'")
    rover = None if form["rover"] is None else int(form["rover"])
    if rover is not None and rover not in rovers:
        raise PlanError(f"{text!r}: there is no rover {rover}")
    return PlannedFault(text.strip(), rover, float(form["at"]), event, lasts)
