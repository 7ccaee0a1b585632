"""Of the product of several parameters, those in which every two or three values meet.

``WHOLE_PRODUCTS=1`` adds the rest of each product.
"""

import os
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations, product
from typing import Any

import pytest

Chosen = tuple[int, ...]  # the index of a value for each parameter


def every_pair(**values: Sequence[Any] | Mapping[str, Any]) -> pytest.MarkDecorator:
    """Parametrize so that every two values meet; as a volume, so that every three do.

    The values of a parameter may be given by their names.
    """
    axes = [list(named(each)) for each in values.values()]
    sizes = [len(axis) for axis in axes]
    pairs = covering(sizes, together=2)
    volume = covering(sizes, together=3) if len(sizes) > 2 else set()
    cases = []
    for chosen in product(*map(range, sizes)):
        if chosen not in pairs | volume and "WHOLE_PRODUCTS" not in os.environ:
            continue
        names, picked = zip(*(axis[i] for axis, i in zip(axes, chosen, strict=True)), strict=True)
        marks = () if chosen in pairs else (pytest.mark.volume,)
        cases.append(pytest.param(*picked, id="-".join(names), marks=marks))
    return pytest.mark.parametrize(tuple(values), cases)


def named(values: Sequence[Any] | Mapping[str, Any]) -> Iterable[tuple[str, Any]]:
    """Return the values of a parameter with their names."""
    return values.items() if isinstance(values, Mapping) else ((str(each), each) for each in values)


def covering(sizes: Sequence[int], *, together: int) -> set[Chosen]:
    """Return combinations in which every so many values meet, the same each time."""

    def met(chosen: Chosen) -> set[Any]:
        return set(combinations(enumerate(chosen), together))

    everything = list(product(*map(range, sizes)))
    missing = {each for chosen in everything for each in met(chosen)}
    found: set[Chosen] = set()
    while missing:
        best = max(everything, key=lambda chosen: len(missing & met(chosen)))
        found.add(best)
        missing -= met(best)
    return found
