"""Of the product of several parameters, those that ``tools/test`` runs: every pair of values."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations, product
from typing import Any

import pytest

Chosen = tuple[int, ...]  # the index of a value for each parameter


def every_pair(**values: Sequence[Any] | Mapping[str, Any]) -> pytest.MarkDecorator:
    """Parametrize with the whole product; what no pair of values needs is a volume.

    The values of a parameter may be given by their names.
    """
    axes = [list(named(each)) for each in values.values()]
    needed = covering([len(axis) for axis in axes])
    cases = []
    for chosen in product(*(range(len(axis)) for axis in axes)):
        names, picked = zip(*(axis[i] for axis, i in zip(axes, chosen, strict=True)), strict=True)
        marks = () if chosen in needed else (pytest.mark.volume,)
        cases.append(pytest.param(*picked, id="-".join(names), marks=marks))
    return pytest.mark.parametrize(tuple(values), cases)


def named(values: Sequence[Any] | Mapping[str, Any]) -> Iterable[tuple[str, Any]]:
    """Return the values of a parameter with their names."""
    return values.items() if isinstance(values, Mapping) else ((str(each), each) for each in values)


def covering(sizes: Sequence[int]) -> set[Chosen]:
    """Return combinations in which every two values of two parameters meet, the same each time."""
    everything = list(product(*map(range, sizes)))
    missing = {pair for chosen in everything for pair in pairs_of(chosen)}
    found: set[Chosen] = set()
    while missing:
        best = max(everything, key=lambda chosen: len(missing & pairs_of(chosen)))
        found.add(best)
        missing -= pairs_of(best)
    return found


def pairs_of(chosen: Chosen) -> set[Any]:
    """Return the pairs of values that meet in a combination."""
    return set(combinations(enumerate(chosen), 2))
