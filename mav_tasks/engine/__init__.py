"""The whole server as one pure object: services and tasks composed."""
