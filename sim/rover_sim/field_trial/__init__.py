"""A trial of the task server on a rover as it is: a table of what must hold, with figures.

``ground`` is where it takes place, a real rover with ``mav-tasks serve`` or a simulated one in
virtual time; each row of the table is a coroutine that drives the rover through it.
"""
