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


EVERYBODY = Address(BROADCAST, BROADCAST)


@cache  # there are 65,536, and each packet asks for some
def address_of(system_id: int, component_id: int) -> Address:
    """Return an address as it comes from the wire."""
    return Address(system_id, component_id)


#: who uses an address, in words
_PEOPLE = {
    "243/190": "the web page",
    "244/190": "the command line or a script",
    "245/190": "a MAVSDK script",
    "255/190": "a ground station",
}


def who_is(actor: str) -> str:
    """Return a submitter's text in words: the name of its key, else what uses such an address."""
    place, _, key = actor.partition(" signed ")
    address = place.partition("@")[0]
    return key or _PEOPLE.get(address, address)
