"""Recordings as MCAP files: ``mav-tasks export``.

dialects/recordings.md has the convention. Only ``writing`` imports the mcap package, which is an
extra.
"""
