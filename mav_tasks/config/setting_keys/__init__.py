"""The keys of all settings: names, meanings, ranges; for configuration and MAVLink parameters.

Pure. ``shapes`` has the kinds of values; ``mav_tasks.config.settings`` declares the keys with them.
"""
