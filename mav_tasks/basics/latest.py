"""Memories of bounded size: tables that forget their oldest entries. Pure."""

from typing import TypeVar

K = TypeVar("K")
V = TypeVar("V")


def keep_latest(table: dict[K, V], key: K, value: V, *, most: int) -> None:
    """Put an entry into a table as its newest one; drop the oldest ones beyond ``most``."""
    table.pop(key, None)
    table[key] = value
    if len(table) > most:
        shorten(table, most)


def shorten(table: dict[K, V], most: int) -> None:
    """Drop the oldest entries beyond a number."""
    while len(table) > most:
        del table[next(iter(table))]
