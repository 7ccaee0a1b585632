"""The commands of clients: parsed, submitted as tasks, executed at once or forwarded."""
