"""Guidance: path geometry and closed-loop control of a rover. Pure."""
