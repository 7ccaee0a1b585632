"""The task domain: goals, states, order, guidance. Pure; it knows nothing of MAVLink."""
