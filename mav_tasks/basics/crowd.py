"""Who gives way when there are too many: one of those who have most. Pure."""

from collections import Counter
from collections.abc import Callable, Hashable, Sequence
from typing import TypeVar

T = TypeVar("T")


def first_of_crowd(items: Sequence[T], owner: Callable[[T], Hashable]) -> T:
    """Return the first item of the owner that has the most of them; there is at least one item.

    So nobody loses a place to somebody who has more of them.
    """
    of_each = Counter(map(owner, items))
    return max(items, key=lambda item: of_each[owner(item)])
