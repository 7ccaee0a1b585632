"""``mav-tasks sim``: the simulated rover's own command."""

from rover_sim.app import sim as sim
