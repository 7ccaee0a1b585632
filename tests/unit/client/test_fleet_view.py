"""A client's view of a rover: each figure of its telemetry, and None for what it does not say."""

import json
from math import inf, nan

import pytest

from mav_tasks.client.fleet_view import FleetView
from mav_tasks.client.json_form import vehicle_json
from mav_tasks.client.values import VehicleStatus
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Encoder
from mav_tasks.mavlink.packet import split_datagram
from mav_tasks.services.prearm_check import PREARM_CHECK

ROVER = Address(3, 1)
NO_CURRENT, NO_CHARGE, NO_VOLTAGE = -1, -1, 65535


def system(
    *, present: int = 0, healthy: int = 0, voltage: int = NO_VOLTAGE, charge: int = NO_CHARGE
) -> m.SysStatus:
    return m.SysStatus(present, present, healthy, 0, voltage, NO_CURRENT, charge, 0, 0, 0, 0, 0, 0)


def shown(*messages: m.Message, at: float = 10.0, now: float = 10.0) -> VehicleStatus:
    fleet, encoder = FleetView(), Encoder(ROVER)
    fleet.served_by(Address(3, 191), 0.5, now=at)
    for message in messages:
        for packet in split_datagram(encoder.encode(message)):
            assert fleet.telemetry(packet, now=at)
    view = fleet.get(3)
    assert view is not None
    return view.status(Decoder(), now=now)


def test_a_position_has_both_forms_and_an_age() -> None:
    local = m.LocalPositionNed(0, 1.5, -2.5, 0, 3.0, 4.0, 0)
    on_earth = m.GlobalPositionInt(0, 473977420, -85456000, 0, 0, 0, 0, 0, 0)
    rover = shown(local, on_earth, at=10.0, now=12.5)
    assert (rover.north, rover.east, rover.speed) == (1.5, -2.5, 5.0)
    assert (rover.latitude, rover.longitude) == (47.397742, -8.5456)
    assert rover.position_age == 2.5


def test_what_a_rover_does_not_say_is_unknown() -> None:
    rover = shown(system())
    assert (rover.battery, rover.voltage, rover.is_ready) == (None, None, None)
    assert (rover.latitude, rover.position_age) == (None, None)


def test_the_battery_is_a_fraction_and_volts() -> None:
    rover = shown(system(voltage=12_340, charge=87))
    assert (rover.battery, rover.voltage) == (0.87, 12.34)


@pytest.mark.parametrize(
    ("present", "healthy", "ready"),
    [(True, True, True), (True, False, False), (False, True, True), (False, False, None)],
)
def test_checks_before_arming(present: bool, healthy: bool, ready: bool | None) -> None:
    message = system(present=PREARM_CHECK * present, healthy=PREARM_CHECK * healthy)
    assert shown(message).is_ready is ready


def test_packets_of_rovers_that_no_server_has_are_not_kept() -> None:
    fleet = FleetView()
    (packet,) = split_datagram(Encoder(ROVER).encode(system()))
    assert not fleet.telemetry(packet, now=1.0)


def test_a_number_that_is_none_is_unknown() -> None:
    """An estimator that has failed sends NaN; JSON has none, so it would end the web process."""
    place = m.LocalPositionNed(0, nan, inf, 0, nan, 1.0, 0)
    rover = shown(place, m.Attitude(0, 0.0, 0.0, nan, 0.0, 0.0, 0.0))
    assert (rover.north, rover.east, rover.speed, rover.yaw) == (None,) * 4
    json.dumps(vehicle_json(rover), allow_nan=False)
