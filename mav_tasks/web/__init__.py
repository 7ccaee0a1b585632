"""The web page and the HTTP API: a process of its own, and an ordinary client of the task server.

``live`` keeps one view of the server for all browsers, ``hub`` sends its changes to their event
streams, ``api_…`` answers requests, ``guard`` decides which requests pass. The task server is
another process, so no browser can delay a setpoint.
"""
