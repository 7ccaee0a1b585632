"""Pairs of parameters: few combinations, in which every two values meet."""

from itertools import combinations, product

import pytest

from tests.kit.pairs import covering, every_pair


@pytest.mark.parametrize(
    ("sizes", "most"), [((2, 2), 4), ((4, 2, 3, 5), 24), ((4, 2, 3, 4), 20), ((2, 2, 5, 3), 18)]
)
def test_every_two_values_meet(sizes: tuple[int, ...], most: int) -> None:
    found = covering(sizes)
    for (i, many), (j, others) in combinations(enumerate(sizes), 2):
        met = {(chosen[i], chosen[j]) for chosen in found}
        assert met == set(product(range(many), range(others)))
    assert len(found) <= most


def test_nothing_of_the_product_is_left_out() -> None:
    mark = every_pair(letter="ab", number={"one": 1, "two": 2}, is_so=[False, True])
    names, cases = mark.args
    assert names == ("letter", "number", "is_so")
    assert {case.values for case in cases} == set(product("ab", (1, 2), (False, True)))
    assert cases[0].id == "a-one-False"
    assert 4 <= sum(not case.marks for case in cases) < 8
