"""``mav-tasks demo``: the demonstration's own command."""

from rover_sim.demo.app import demo as demo
