"""The engine: the whole server as one pure object, composed of services and tasks."""
