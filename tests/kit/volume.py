"""How much tests try: some of their seeds and cases in each run, all with ``tools/test --long``."""

import os
from collections.abc import Sequence
from typing import TypeVar

T = TypeVar("T")

#: asked for the long run
LONG = "LONG" in os.environ


def tries(count: int, *, long: int) -> int:
    """Return how often to try."""
    return long if LONG else count


def some(cases: Sequence[T], *numbers: int) -> Sequence[T]:
    """Return the cases with these numbers, from 0; in a long run all."""
    return cases if LONG else [cases[number] for number in numbers]
