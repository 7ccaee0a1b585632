"""Recordings as MCAP files, and telemetry logs back from them: ``mav-tasks export``.

dialects/README.md, "Recordings as MCAP", has the convention. Only ``writing`` and ``restoring``
import the mcap package, which is an extra.
"""
