"""The sender of a request, and what its role permits. Roles are those of signing keys. Pure."""

from dataclasses import dataclass

from mav_tasks.settings import ROLES

#: what each role may do; every role may stop and pause
MAY = {
    "observer": frozenset({"stop", "pause"}),
    "submitter": frozenset({"stop", "pause", "submit", "mission"}),
    "operator": frozenset(
        {"stop", "pause", "submit", "mission", "resume", "cancel", "modify", "release", "clear"}
    ),
}
MAY["safety"] = MAY["operator"] | {"fence"}
assert tuple(MAY) == ROLES, "each role of the server has its line"

OPEN_NAME = "local"  # the name of users without a token


@dataclass(frozen=True, slots=True)
class Identity:
    """A person or program: the name of its token, OPEN_NAME without one, and its role."""

    name: str
    role: str

    @property
    def may(self) -> frozenset[str]:
        """The actions that its role permits."""
        return MAY[self.role]
