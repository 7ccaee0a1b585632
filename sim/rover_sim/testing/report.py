"""The report of a failing test: seed, rovers, and the server's journal."""

from rover_sim.testing.rover_world import RoverWorld

LAST_EVENTS = 20


def describe_world(world: RoverWorld) -> str:
    """Return the state of the world in lines."""
    options, events = world.options, world.server.events[-LAST_EVENTS:]
    lines = [
        f"seed {world.seed} (the same again: --rover-seed {world.seed})",
        f"{options.persona}, {options.body} body, {world.now:.2f} s of virtual time",
        *map(repr, world.rovers),
        *(f"{event.at:9.2f} s  {event}" for event in events),
    ]
    return "\n".join(lines)
