"""Missions, fences and rally points: taken in, kept, shown and reported on."""
