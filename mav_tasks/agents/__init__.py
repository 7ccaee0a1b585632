"""Offers a task server to AI agents, by the Model Context Protocol."""
