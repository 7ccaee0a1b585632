"""A field trial of the task server on a given rover: a table of requirements, with figures.

``ground`` is the environment: a real rover with ``mav-tasks serve`` or a simulated one in virtual
time. Each row of the table is a coroutine that drives the rover.
"""
