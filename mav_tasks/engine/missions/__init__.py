"""Missions, fences and rally points: upload, storage, download and progress reports."""
