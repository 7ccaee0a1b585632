"""A station in a complete world of server, rover and station."""

from math import inf

from rover_sim.geo import DEFAULT_ORIGIN
from tests.kit.cases import for_each
from tests.kit.px4 import PROMPT_GENERIC, PROMPT_PX4
from tests.kit.qgc.party import QgcParty
from tests.kit.qgc.profile import MASTER, V4, Profile
from tests.kit.world import PROMPT, World

CONNECTED_WITHIN = 2.0  # s; a real one needs 0.42 with everything answered at once [11.1]

each_make = for_each("persona", [PROMPT, PROMPT_PX4, PROMPT_GENERIC])
#: makes that the station can guide [1.5]
each_guided = for_each("persona", [PROMPT, PROMPT_PX4])
each_version = for_each("profile", [V4, MASTER])


def join(world: World, profile: Profile, name: str = "qgc") -> QgcParty:
    """Let a station dial in, connect, and receive the rover's place and home."""
    party = QgcParty(world.net, name, profile)
    world.join(party)
    world.until(lambda: party.is_connected, within=CONNECTED_WITHIN)
    state = party.vehicle.state
    world.until(lambda: state.place and state.home, within=CONNECTED_WITHIN)
    return party


def place(north: float, east: float) -> tuple[int, int]:
    """Return a place in degE7, from metres."""
    return DEFAULT_ORIGIN.to_global(north, east)


def degrees(north: float, east: float) -> tuple[float, float]:
    """Return a place in degrees, from metres."""
    x, y = place(north, east)
    return x / 1e7, y / 1e7


def slowest_ack(party: QgcParty) -> float:
    """Return the time of the slowest ack, s; inf if one never came."""
    return max(
        (inf if sent.acked_at is None else sent.took for sent in party.vehicle.commands.sent),
        default=0.0,
    )
