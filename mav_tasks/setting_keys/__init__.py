"""The keys of all settings: names, meanings, ranges. Configuration and parameters read them here.

Pure data and what follows from it; ``shapes`` has what values there are, ``table`` the keys.
"""
