"""Of the product of several parameters, those combinations in which every two values meet.

A long run (``kit/volume.py``) adds the rest of each product.
"""

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations, product
from typing import Any

import pytest

from tests.kit.volume import LONG

Chosen = tuple[int, ...]  # the index of a value for each parameter


def every_pair(**values: Sequence[Any] | Mapping[str, Any]) -> pytest.MarkDecorator:
    """Parametrize so that every two values meet.

    The values of a parameter may be given by their names.
    """
    axes = [list(named(each)) for each in values.values()]
    sizes = [len(axis) for axis in axes]
    everything = product(*map(range, sizes))
    cases = []
    for chosen in everything if LONG else sorted(covering(sizes)):
        names, picked = zip(*(axis[i] for axis, i in zip(axes, chosen, strict=True)), strict=True)
        cases.append(pytest.param(*picked, id="-".join(names)))
    return pytest.mark.parametrize(tuple(values), cases)


def named(values: Sequence[Any] | Mapping[str, Any]) -> Iterable[tuple[str, Any]]:
    """Return the values of a parameter with their names."""
    return values.items() if isinstance(values, Mapping) else ((str(each), each) for each in values)


def covering(sizes: Sequence[int]) -> set[Chosen]:
    """Return combinations in which every two values meet, the same each time."""

    def met(chosen: Chosen) -> set[Any]:
        return set(combinations(enumerate(chosen), 2))

    everything = list(product(*map(range, sizes)))
    missing = {each for chosen in everything for each in met(chosen)}
    found: set[Chosen] = set()
    while missing:
        best = max(everything, key=lambda chosen: len(missing & met(chosen)))
        found.add(best)
        missing -= met(best)
    return found
