"""Pairs of parameters: few combinations, in which every two values meet."""

from itertools import combinations, product
from typing import Any

import pytest

from tests.kit import pairs
from tests.kit.pairs import covering, every_pair

BOTH = [False, True]
SIZES = [(2, 2), (4, 2, 3, 5), (4, 2, 3, 4), (2, 2, 5, 3)]


def test_every_two_values_meet() -> None:
    for sizes, most in [*zip(SIZES, [4, 24, 20, 18], strict=True)]:
        found = covering(sizes)
        for (i, many), (j, others) in combinations(enumerate(sizes), 2):
            met = {(chosen[i], chosen[j]) for chosen in found}
            assert met == set(product(range(many), range(others)))
        assert len(found) <= most


def test_the_rest_of_the_product_is_there_on_request(monkeypatch: pytest.MonkeyPatch) -> None:
    def cases() -> Any:
        return every_pair(letter="ab", number={"one": 1, "two": 2}, is_so=BOTH, is_it=BOTH).args[1]

    few = cases()
    assert few[0].id == "a-one-False-False"
    assert 4 <= len(few) < 16
    monkeypatch.setattr(pairs, "LONG", True)
    every = {case.values for case in cases()}
    assert every == set(product("ab", (1, 2), BOTH, BOTH))
    assert {case.values for case in few} < every
