"""A vehicle's own word that it is outside its own fence."""

import pytest

from mav_tasks.engine.vehicles.own_fence import GEOFENCE, is_breached
from mav_tasks.mavlink.messages import SysStatus


@pytest.mark.parametrize(
    ("enabled", "healthy", "breached"),
    [(GEOFENCE, 0, True), (GEOFENCE, GEOFENCE, False), (0, 0, False), (0, GEOFENCE, False)],
)
def test_a_fence_that_is_on_and_not_healthy_is_breached(
    enabled: int, healthy: int, *, breached: bool
) -> None:
    status = SysStatus(enabled, enabled, healthy, 0, 12000, -1, -1, 0, 0, 0, 0, 0, 0)
    assert is_breached(status) is breached
