"""Helpers for true poses: the time and the distance until the rover stands."""

from collections.abc import Sequence
from typing import NamedTuple

from rover_sim.compare.trace import TruePose, path_length

STANDS = 0.03  # m/s, true speed
STANDS_FOR = 0.4  # s of standing, or up to the end of the poses


class Rest(NamedTuple):
    """Time and distance to standstill."""

    after: float  # s
    way: float  # m


def rest_of(poses: Sequence[TruePose], start: float) -> Rest | None:
    """Return when the rover first stood for ``STANDS_FOR``, counted from ``start``, or None."""
    since = None  # index of the first pose of the present standing
    for i, pose in enumerate(poses):
        if abs(pose.speed) >= STANDS:
            since = None
        elif since is None:
            since = i
        if since is not None and pose.time - poses[since].time >= STANDS_FOR:
            break
    if since is None:
        return None
    return Rest(poses[since].time - start, path_length(list(poses[: since + 1])))
