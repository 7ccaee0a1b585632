"""Which frame a vehicle's positions are in: said, worked out, changed; never guessed from home."""

import pytest

from mav_tasks.engine.vehicles.frame_monitor import FrameMonitor, Seen
from mav_tasks.mavlink import messages as m
from mav_tasks.tasks.frames import to_global
from mav_tasks.tasks.goal import GlobalPlace, LocalPlace

ORIGIN = GlobalPlace(-353_632_620, 1_491_652_370)
ELSEWHERE = GlobalPlace(-353_632_620, 1_491_653_370)


def said(origin: GlobalPlace) -> m.GpsGlobalOrigin:
    return m.GpsGlobalOrigin(origin.latitude_degE7, origin.longitude_degE7, 0)


def local(north: float, east: float, *, boot_ms: int = 5_000) -> m.LocalPositionNed:
    return m.LocalPositionNed(boot_ms, north, east, 0, 0, 0, 0)


def on_earth(
    north: float, east: float, *, boot_ms: int = 5_000, origin: GlobalPlace = ORIGIN
) -> m.GlobalPositionInt:
    place = to_global(LocalPlace(north, east), origin)
    latitude, longitude = place.latitude_degE7, place.longitude_degE7
    return m.GlobalPositionInt(boot_ms, latitude, longitude, 0, 0, 0, 0, 0, 0)


def test_the_origin_is_what_the_vehicle_says() -> None:
    monitor = FrameMonitor()
    monitor.receive(said(ORIGIN))
    assert monitor.origin == ORIGIN
    assert monitor.frame() is None
    monitor.boot(7.0, now=12.0)
    frame = monitor.frame()
    assert frame is not None
    assert (frame.latitude_degE7, frame.booted_at) == (ORIGIN.latitude_degE7, 7.0)


def test_home_is_no_origin() -> None:
    monitor = FrameMonitor()
    home = m.HomePosition(
        ELSEWHERE.latitude_degE7, ELSEWHERE.longitude_degE7, 0, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0
    )
    monitor.receive(home)
    assert (monitor.origin, monitor.home) == (None, ELSEWHERE)


@pytest.mark.parametrize("order", [1, -1])
def test_it_is_worked_out_from_both_positions_of_one_instant(order: int) -> None:
    monitor = FrameMonitor()
    both: list[Seen] = [local(120.0, -40.0), on_earth(120.0, -40.0)]
    for message in both[::order]:
        monitor.receive(message)
    assert monitor.origin is not None
    assert abs(monitor.origin.latitude_degE7 - ORIGIN.latitude_degE7) <= 1
    assert abs(monitor.origin.longitude_degE7 - ORIGIN.longitude_degE7) <= 1


def test_positions_of_different_instants_are_not_put_together() -> None:
    monitor = FrameMonitor()
    monitor.receive(local(120.0, -40.0, boot_ms=5_000))
    monitor.receive(on_earth(120.5, -40.0, boot_ms=5_200))
    assert monitor.origin is None


def test_a_first_origin_is_worked_out_from_instants_that_are_near_to_each_other() -> None:
    """A PX4 whose origin was told before anybody listened sends the two 24 to 80 ms apart."""
    monitor = FrameMonitor()
    moving = local(120.0, -40.0, boot_ms=5_000)
    moving.vx = 1.0
    monitor.receive(moving)
    monitor.receive(on_earth(120.06, -40.0, boot_ms=5_060))
    origin = monitor.origin
    assert origin is not None
    assert abs(origin.latitude_degE7 - ORIGIN.latitude_degE7) <= 2
    monitor.receive(on_earth(122.0, -40.0, boot_ms=5_060 + 20))
    assert (monitor.origin, monitor.changed) == (origin, False), "it may have been corrected"


def test_a_small_difference_is_rounding_and_a_large_one_another_origin() -> None:
    monitor = FrameMonitor()
    monitor.receive(said(ORIGIN))
    monitor.receive(said(ORIGIN))
    assert not monitor.changed
    monitor.receive(said(ELSEWHERE))
    assert monitor.changed
    assert monitor.origin == ELSEWHERE


def test_what_is_worked_out_changes_only_by_much() -> None:
    monitor = FrameMonitor()
    for number, east in enumerate((0.0, 0.3, -0.4)):
        boot = 5_000 + number
        monitor.receive(local(10.0, 10.0, boot_ms=boot))
        monitor.receive(on_earth(10.0, 10.0 + east, boot_ms=boot))
    assert not monitor.changed
    monitor.receive(local(10.0, 10.0, boot_ms=9_000))
    monitor.receive(on_earth(10.0, 10.0, boot_ms=9_000, origin=ELSEWHERE))
    assert monitor.changed


@pytest.mark.parametrize("place", [GlobalPlace(0, 0), GlobalPlace(900_000_001, 5)])
def test_an_impossible_place_is_none(place: GlobalPlace) -> None:
    monitor = FrameMonitor()
    monitor.receive(said(place))
    assert monitor.origin is None


def test_a_restart_forgets_the_frame_and_keeps_home() -> None:
    monitor = FrameMonitor()
    monitor.receive(said(ORIGIN))
    monitor.receive(local(0, 0))
    monitor.forget()
    assert (monitor.origin, monitor.frame()) == (None, None)
    monitor.receive(said(ELSEWHERE))
    assert not monitor.changed
