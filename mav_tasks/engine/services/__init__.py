"""MAVLink microservices, one protocol role a file. Pure; they know nothing of tasks."""
