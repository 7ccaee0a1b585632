"""The deterministic simulation: stories of a seed, played in virtual time; see ``story.py``."""
