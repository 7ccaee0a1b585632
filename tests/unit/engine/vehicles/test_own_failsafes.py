"""Which failsafe has changed a vehicle's mode, told before the mode is shown or after."""

import pytest

from mav_tasks.engine.vehicles.own_failsafes import (
    FENCE,
    GEOFENCE,
    TOLD_WITHIN,
    News,
    OwnFailsafes,
    is_breached,
)
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavSeverity
from mav_tasks.mavlink.messages import SysStatus
from mav_tasks.services.statustext import chunks

ROVER = Address(1, 1)
GONE = "GCS Failsafe"


def says(failsafes: OwnFailsafes, words: str, *, now: float) -> News:
    [message] = chunks(MavSeverity.WARNING, words, text_id=1)
    return failsafes.receive_text(ROVER, message, now=now)


def fence(failsafes: OwnFailsafes, *, outside: bool, now: float) -> News:
    healthy = 0 if outside else GEOFENCE
    status = SysStatus(GEOFENCE, GEOFENCE, healthy, 0, 12000, -1, -1, 0, 0, 0, 0, 0, 0)
    return failsafes.receive_status(status, now=now)


def test_one_that_was_told_before_names_the_mode() -> None:
    failsafes = OwnFailsafes()
    assert says(failsafes, GONE, now=1.0) == News()
    assert failsafes.mode_changed(now=1.2) == GONE


def test_one_that_is_told_a_moment_after_explains_it_once() -> None:
    failsafes = OwnFailsafes()
    assert failsafes.mode_changed(now=1.0) == ""
    assert says(failsafes, GONE, now=1.0 + TOLD_WITHIN) == News(GONE)
    assert says(failsafes, GONE, now=1.1 + TOLD_WITHIN) == News()


def test_one_that_is_told_later_explains_nothing() -> None:
    failsafes = OwnFailsafes()
    failsafes.mode_changed(now=1.0)
    assert says(failsafes, GONE, now=1.1 + TOLD_WITHIN) == News()


def test_its_fence_explains_a_mode_as_long_as_it_is_outside() -> None:
    failsafes = OwnFailsafes()
    failsafes.mode_changed(now=1.0)
    assert fence(failsafes, outside=True, now=1.5) == News(FENCE, is_outside=True)
    assert fence(failsafes, outside=True, now=2.5) == News()
    assert failsafes.mode_changed(now=9.0) == FENCE
    assert fence(failsafes, outside=False, now=9.5) == News(is_outside=False)
    assert failsafes.mode_changed(now=20.0) == ""


@pytest.mark.parametrize(
    ("enabled", "healthy", "breached"),
    [(GEOFENCE, 0, True), (GEOFENCE, GEOFENCE, False), (0, 0, False), (0, GEOFENCE, False)],
)
def test_a_fence_that_is_on_and_not_healthy_is_breached(
    enabled: int, healthy: int, *, breached: bool
) -> None:
    status = SysStatus(enabled, enabled, healthy, 0, 12000, -1, -1, 0, 0, 0, 0, 0, 0)
    assert is_breached(status) is breached
