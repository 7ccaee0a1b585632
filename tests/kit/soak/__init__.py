"""Random lives of whole worlds, packets that are not as they should be, and any text at all.

The suite and ``tools/soak.py`` run the same code; only how long differs. Whatever goes wrong says
the seed that brings it back.
"""
