"""The task domain: goals, states, scheduling and guidance. Pure, and independent of MAVLink."""
