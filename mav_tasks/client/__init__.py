"""The client library: submit tasks from a script. Its public names are in ``mav_tasks``."""
