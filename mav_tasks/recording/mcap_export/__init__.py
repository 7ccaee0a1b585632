"""Recordings as MCAP files: ``mav-tasks export``.

dialects/README.md, "Recordings as MCAP", has the convention. Only ``writing`` imports the mcap
package, which is an extra.
"""
