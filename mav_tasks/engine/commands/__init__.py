"""What clients ask for by a command, and what becomes of it."""
