"""Timed faults, as ``--fault`` takes them: parsing only, no rover is touched here.

    [rover 2] at 10 s: block-wheel left for 5 s

``ACTIONS`` lists the faults. A lasting fault lasts for the given time, or for good.
"""

import re
from collections.abc import Callable, Container, Iterable, Mapping
from dataclasses import dataclass
from math import inf, radians
from typing import cast

from rover_sim.actuators import Actuator, output_of, wheels_of
from rover_sim.faults import NO_FAULTS, Faults
from rover_sim.frames import Frame
from rover_sim.manual_control import BodyByHand
from rover_sim.vehicle import Vehicle

NUMBER = r"\d+(?:\.\d*)?|\.\d+"
FORM = re.compile(
    rf"(?:rover\s+(?P<rover>\d+)\s+)?at\s+(?P<at>{NUMBER})\s*s?\s*:\s*(?P<name>[a-z-]+)"
    rf"(?P<rest>.*?)(?:\s+for\s+(?P<lasts>{NUMBER})\s*s?)?\s*",
    re.IGNORECASE,
)
EXAMPLE = "at 10 s: block-wheel left for 5 s"


class PlanError(Exception):
    """A fault that cannot be parsed; the message is one line for the user."""


@dataclass(frozen=True, slots=True)
class Lasting:
    """A fault that lasts until its end."""

    faults: Faults = NO_FAULTS
    blocked: frozenset[Actuator] = frozenset()


#: what happens at once, to a vehicle at a time
Event = Callable[[Vehicle, float], None]
Words = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class PlannedFault:
    """One fault with its time."""

    text: str  # as given
    rover: int | None  # system id; None: every rover
    at: float  # s since the simulator started
    event: Lasting | Event
    lasts: float = inf  # s


def _block_wheel(words: Words, _frame: Frame) -> Lasting:
    return Lasting(blocked=wheels_of(_only(words, "left, right or all")))


def _freeze_output(words: Words, frame: Frame) -> Lasting:
    output = output_of(_only(words, "the name of an output"), frame)
    return Lasting(Faults(outputs_frozen=frozenset({output})))


def _push(words: Words, _frame: Frame) -> Event:
    metres, direction = _amount(words, unit="m", known=("forward", "back", "left", "right"))
    signed = -metres if direction in ("back", "left") else metres
    is_along = direction in ("forward", "back")
    return _moved(*((signed, 0.0) if is_along else (0.0, signed)), 0.0)


def _turn(words: Words, _frame: Frame) -> Event:
    degrees, direction = _amount(words, unit="deg", known=("right", "left"))
    return _moved(0.0, 0.0, radians(degrees if direction == "right" else -degrees))


def _moved(forward: float, right: float, turn: float) -> Event:
    def push(vehicle: Vehicle, _now: float) -> None:
        cast(BodyByHand, vehicle.body).push(forward, right, turn)

    return push


def _plain(event: Lasting | Event) -> Callable[[Words, Frame], Lasting | Event]:
    def read(words: Words, _frame: Frame) -> Lasting | Event:
        if words:
            raise ValueError(f"unexpected {' '.join(words)!r}")
        return event

    return read


#: action name: its syntax for the user, and its parser
ACTIONS: Mapping[str, tuple[str, Callable[[Words, Frame], Lasting | Event]]] = {
    "block-wheel": ("block-wheel left|right|all", _block_wheel),
    "freeze-output": ("freeze-output left|right (ackermann: throttle|steering)", _freeze_output),
    "lose-gps": ("lose-gps", _plain(Lasting(Faults(gps_lost=True)))),
    "breach-fence": ("breach-fence", _plain(Lasting(Faults(outside_fence=True)))),
    "freeze-position": ("freeze-position", _plain(Lasting(Faults(position_frozen=True)))),
    "cut-link": ("cut-link", _plain(Lasting(Faults(silent=True, deaf=True)))),
    "push": ("push 0.5 m forward|back|left|right", _push),
    "turn": ("turn 30 deg right|left", _turn),
    "reboot": ("reboot", _plain(lambda vehicle, now: vehicle.autopilot.reboot(now=now))),
    "disarm": (
        "disarm",
        _plain(lambda vehicle, now: vehicle.autopilot.operator_arm(False, now=now)),
    ),
}
HELP = (
    f"Cause a fault at the given time, for example '{EXAMPLE}'; repeatable."
    f" Faults: {'; '.join(form for form, _ in ACTIONS.values())}."
    " Prefix 'rover 2' selects one of several rovers; without 'for' the fault is permanent."
)


def read_fault(text: str, frame: Frame) -> PlannedFault:
    """Parse one fault. Raise PlanError."""
    form = FORM.fullmatch(text.strip())
    if form is None:
        raise PlanError(f"not understood: {text!r}; for example: {EXAMPLE}")
    name = form["name"].lower()
    if name not in ACTIONS:
        raise PlanError(f"unknown fault {name!r} in {text!r}; expected one of {', '.join(ACTIONS)}")
    written, read = ACTIONS[name]
    try:
        event = read(tuple(form["rest"].lower().split()), frame)
    except ValueError as error:
        raise PlanError(f"{text!r}: {error}; write: {written}") from error
    lasts = float(form["lasts"] or inf)
    if form["lasts"] is not None and not isinstance(event, Lasting):
        raise PlanError(f"{text!r}: {name} is over at once, leave out 'for'")
    rover = None if form["rover"] is None else int(form["rover"])
    return PlannedFault(text.strip(), rover, float(form["at"]), event, lasts)


def _only(words: Words, what: str) -> str:
    if len(words) != 1:
        raise ValueError(f"expected {what}")
    return words[0]


def _amount(words: Words, *, unit: str, known: Words) -> tuple[float, str]:
    """Return the number and the direction of "0.5 m left", "0.5m left", "left 0.5 m"."""
    joined = re.fullmatch(
        rf"(?:(?P<before>[a-z]+) )?(?P<number>{NUMBER}) ?(?:{unit})?(?: (?P<after>[a-z]+))?",
        " ".join(words),
    )
    if joined is None or (joined["before"] and joined["after"]):
        raise ValueError("expected an amount and a direction")
    direction = joined["before"] or joined["after"] or known[0]
    if direction not in known:
        raise ValueError(f"expected {', '.join(known)}, not {direction!r}")
    return float(joined["number"]), direction


def check_rovers(plan: Iterable[PlannedFault], numbers: Container[int]) -> None:
    """Raise PlanError if a fault names a rover that does not exist."""
    for fault in plan:
        if fault.rover is not None and fault.rover not in numbers:
            raise PlanError(f"{fault.text!r}: there is no rover {fault.rover}")
