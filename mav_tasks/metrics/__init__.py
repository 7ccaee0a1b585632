"""Metrics of a running process for Prometheus: figures, their names and text, and the HTTP server.

``exposition``, ``process`` and ``http_server`` are independent of the task server: any process can
use them. ``families`` names the server's own figures, ``collector`` counts them in the event loop,
and ``pages`` shows them from a thread of its own.
"""
