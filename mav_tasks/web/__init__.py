"""The web page and the HTTP API: a process of its own, and an ordinary client of the task server.

``live`` keeps one view of the server for all browsers, ``hub`` sends its changes to their event
streams, ``api`` answers requests, ``guard`` decides whose requests reach it. Nothing here is in the
server's process: nothing that a browser does can delay a setpoint.
"""
