"""Shrinks a story that fails to the moves that make it fail: delta debugging, each try a replay."""

import re

from tests.simulation.moves import Found, play
from tests.simulation.story import Story

TRIES = 150  # replays at the most
AFTER = 0.2  # s that a try goes on after the time of the fault


def shrink(story: Story, found: Found, *, tries: int = TRIES) -> Story:
    """Return the shortest story found that breaks the same rule."""
    is_at_end = found.at > story.seconds
    until = None if is_at_end else found.at + AFTER
    moves = [move for move in story.moves if is_at_end or move.at <= found.at]
    best = story.without({move.number for move in story.moves} - {m.number for m in moves})
    size = max(1, len(best.moves) // 2)
    while tries > 0 and best.moves:
        for start in range(0, len(best.moves), size):
            part = {move.number for move in best.moves[start : start + size]}
            tries -= 1
            shorter = best.without(part)
            if _kind(play(shorter, until=until)) == _kind(found):
                best = shorter
                break
            if tries <= 0:
                break
        else:
            if size == 1:
                break
            size = max(1, size // 2)
            continue
        size = max(1, min(size, len(best.moves) // 2))
    return best


def _kind(found: Found) -> str:
    """Return what is broken, without times and numbers."""
    return re.sub(r"[\d.]+", "#", found.rule)
