"""Random lives of whole worlds, mutated packets, and fuzzed text.

The suite and ``tools/soak.py`` run the same code for different times. Every failure reports the
seed that reproduces it.
"""
