"""Shared code of the tests: the virtual world, fake clients, observers."""
