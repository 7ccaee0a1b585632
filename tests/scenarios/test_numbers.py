"""Sequence numbers towards clients over a restart of the rover: no loss that is none."""

from pymavlink.dialects.v20 import common

from rover_sim.faults import Faults
from tests.kit.cases import for_each
from tests.kit.world import World

ROVER = (1, 1)
LONG, SHORT = 3.0, 0.5  # s of silence: of a restart, and of a link


def says(world: World, *numbers: int) -> None:
    """Let the rover send heartbeats with these numbers."""
    rover = common.MAVLink(None, *ROVER)
    for number in numbers:
        rover.seq = number
        message = common.MAVLink_heartbeat_message(10, 3, 81, 4, 4, 3)
        world.from_vehicle_side(message.pack(rover), peer="rover1")
        world.run(0.05)


@for_each(
    "silence, first, lost",
    [
        (LONG, 0, 0),
        (LONG, 3, 0),  # the first ones were sent before the link was up
        (SHORT, 0, 150),
        (LONG, 140, 34),  # of a link that was down, and no restart
    ],
)
def test_only_a_restart_of_the_rover_is_no_loss(
    world: World, silence: float, first: int, lost: int
) -> None:
    world.fault(Faults(silent=True))
    world.run(0.5)
    says(world, 103, 104)
    world.client.received.clear()
    says(world, 105)
    world.run(silence)
    says(world, first, first + 1, first + 2)
    assert world.client.gaps(ROVER) == lost
