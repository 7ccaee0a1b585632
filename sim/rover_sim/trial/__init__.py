"""A field trial of the task server on a given rover, which ``mav-tasks trial`` runs.

``rows`` lists what is tried: each row is a coroutine that drives the rover and returns a figure.
``session`` is their common ground: a server, its client and the rover's track. ``running`` puts it
all together for a real rover, ``report`` writes down what came of it.
"""
