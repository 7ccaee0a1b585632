"""The sender of a request: the holder of a key, or a person at this machine. Pure.

What a user may do is the task server's decision. ``may`` is for the page, which offers nothing that
the server would refuse: it is read from the server's own table.
"""

from dataclasses import dataclass

from mav_tasks.engine.clients.rights import RANKS
from mav_tasks.engine.policy import row_of_command
from mav_tasks.engine.policy.messages import BOUNDING_PLAN
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.mavlink.signing import Key

#: what the page offers besides STOP and pause: the row of the server's policy that decides
OFFERED = {
    "submit": row_of_command(MavCmd.TASK_MOVE),
    "resume": row_of_command(MavCmd.DO_PAUSE_CONTINUE),
    "cancel": row_of_command(MavCmd.TASK_CANCEL),
    "modify": row_of_command(MavCmd.TASK_MODIFY),
    "release": row_of_command(MavCmd.TASK_RELEASE),
    "clear": row_of_command(MavCmd.TASK_CLEAR),
    "fence": BOUNDING_PLAN,
}


@dataclass(frozen=True, slots=True)
class Identity:
    """A person or program. ``key`` None: at this machine, with the rights of the web process."""

    name: str
    key: Key | None = None

    @property
    def role(self) -> str | None:
        """The role of its key; None: the server knows what the web process may do."""
        return None if self.key is None else self.key.role

    @property
    def may(self) -> list[str]:
        """What the server may accept from it; some of that for its own tasks only."""
        rank = max(RANKS.values()) if self.key is None else RANKS[self.key.role]
        return sorted(what for what, row in OFFERED.items() if RANKS[row.role] <= rank)


LOCAL = Identity("a local user")
