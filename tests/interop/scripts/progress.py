"""How far a mission is, as MAVSDK's reports tell it, for all faces."""

from typing import Any


def is_told_to_the_end(reports: list[Any]) -> bool:
    """Whether the last item has been reported: another thread may do so after the end is known.

    Not by the latest report: a start that is sent again after the end begins anew.
    """
    return any(each.current == each.total for each in reports)


def pairs(reports: list[Any]) -> list[tuple[int, int]]:
    """Each report as item and number of items."""
    return [(each.current, each.total) for each in reports]
