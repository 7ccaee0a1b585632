"""The client library: tasks for rovers from a script. What is public is in ``mav_tasks`` itself."""
