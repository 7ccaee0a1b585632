"""Who sends a request, and what the role of that permits. Roles are those of signing keys. Pure."""

from dataclasses import dataclass

from mav_tasks.settings import ROLES

#: what each role may do; a halt is permitted to everybody
MAY = {
    "observer": frozenset({"stop", "pause"}),
    "submitter": frozenset({"stop", "pause", "submit", "mission"}),
    "operator": frozenset(
        {"stop", "pause", "submit", "mission", "resume", "cancel", "modify", "release", "clear"}
    ),
}
MAY["safety"] = MAY["operator"] | {"fence"}
assert tuple(MAY) == ROLES, "each role of the server has its line"

OPEN_NAME = "local"  # of whoever needs no token


@dataclass(frozen=True, slots=True)
class Identity:
    """A person or program: the name of its token, OPEN_NAME without one, and its role."""

    name: str
    role: str

    @property
    def may(self) -> frozenset[str]:
        """What it may do."""
        return MAY[self.role]
