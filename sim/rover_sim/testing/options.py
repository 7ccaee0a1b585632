"""The options of a test's simulated rovers, from its markers, and the seed from its name."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any
from zlib import crc32

from rover_sim.frames import Frame
from rover_sim.personas import PERSONAS, Persona

MOST_ROVERS = 250  # system ids
KNOWN = {
    "persona": tuple(PERSONAS),
    "body": ("kinematic", "bullet"),
    "frame": ("", *(frame.value for frame in Frame)),
}


class MarkerError(Exception):
    """A marker with an invalid argument; the message is one line for the test's author."""


@dataclass(frozen=True, slots=True)
class RoverOptions:
    """The arguments of ``simulated_rover``."""

    persona: str = "ardupilot"
    count: int = 1  # of rovers, with system ids in a row
    seed: int | None = None  # None: from the command line, or from the test's name
    body: str = "kinematic"  # or "bullet": real physics, a third of the speed
    frame: str = ""  # "skid", "differential" or "ackermann"; "": the persona's
    limit: float = 3600.0  # virtual s, for one wait
    real_limit: float = 60.0  # s, for one wait

    @property
    def make(self) -> Persona:
        """The persona, on the chosen frame."""
        persona = PERSONAS[self.persona]
        return persona.on(Frame(self.frame)) if self.frame else persona

    def __post_init__(self) -> None:
        """Raise MarkerError for an invalid value."""
        for name, known in KNOWN.items():
            if (value := getattr(self, name)) not in known:
                raise MarkerError(f"{name} must be one of {', '.join(known)}, not {value!r}")
        if type(self.count) is not int or not 1 <= self.count <= MOST_ROVERS:
            raise MarkerError(f"count must be 1 to {MOST_ROVERS}, not {self.count!r}")
        if self.seed is not None and type(self.seed) is not int:
            raise MarkerError(f"seed must be a whole number, not {self.seed!r}")
        for name in ("limit", "real_limit"):
            value = getattr(self, name)
            if not isinstance(value, int | float) or not value > 0:
                raise MarkerError(f"{name} must be above 0 seconds, not {value!r}")


def read_markers(markers: Iterable[tuple[tuple[Any, ...], Mapping[str, Any]]]) -> RoverOptions:
    """Merge the arguments of markers, outermost first. Raise MarkerError."""
    known = [field.name for field in fields(RoverOptions)]
    joined: dict[str, Any] = {}
    for positional, named in markers:
        if positional or not set(named) <= set(known):
            raise MarkerError(f"takes {', '.join(f'{name}=' for name in known)}, by name only")
        joined |= named
    return RoverOptions(**joined)


def seed_of(node_id: str) -> int:
    """Return a seed that stays the same while the test and its file keep their names."""
    path, _, name = node_id.partition("::")
    return crc32(f"{path.rpartition('/')[2]}::{name}".encode())
