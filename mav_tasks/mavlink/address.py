"""Who sends and who is meant: MAVLink system and component ids.

MAVLink guide, "Routing": a target of 0 is a broadcast to all systems, or to all components of one.
"""

from functools import cache
from typing import NamedTuple

BROADCAST = 0
AUTOPILOT = 1  # MAV_COMP_ID_AUTOPILOT1


class Address(NamedTuple):
    """A MAVLink identity, or a target when a part of it is 0 (broadcast)."""

    system_id: int
    component_id: int

    def __str__(self) -> str:
        return f"{self.system_id}/{self.component_id}"

    def reaches(self, other: "Address") -> bool:
        """Whether a message targeted at this address is meant for ``other``."""
        return self.system_id in (BROADCAST, other.system_id) and self.component_id in (
            BROADCAST,
            other.component_id,
        )


@cache  # there are 65,536, and each packet asks for some
def address_of(system_id: int, component_id: int) -> Address:
    """Return an address as it comes from the wire."""
    return Address(system_id, component_id)
