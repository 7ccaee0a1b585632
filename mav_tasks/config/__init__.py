"""The configuration: a TOML file, the environment and flags override the settings' defaults.

``configuration`` merges the sources into settings; ``toml_file`` and ``words`` read the sources.
"""
