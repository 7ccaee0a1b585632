"""The configuration: a TOML file, the environment and flags, over the defaults of the settings.

``sources`` names them, ``configuration`` makes settings of them, each file here does one step.
"""
