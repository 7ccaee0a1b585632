"""Local metres and global degrees."""

import pytest

from mav_tasks.mavlink import messages as m
from rover_sim.geo import DEFAULT_ORIGIN, Origin


@pytest.mark.parametrize("origin", [DEFAULT_ORIGIN, Origin(47.3977, 8.5456, 488.0)])
@pytest.mark.parametrize("place", [(0.0, 0.0), (123.4, -56.7), (-5.0, 800.0)])
def test_there_and_back(origin: Origin, place: tuple[float, float]) -> None:
    assert origin.to_local(*origin.to_global(*place)) == pytest.approx(place, abs=0.02)


def test_a_degree_of_latitude_is_about_111_km() -> None:
    latitude, longitude = DEFAULT_ORIGIN.to_global(111_318.845, 0.0)
    assert latitude - DEFAULT_ORIGIN.latitude_degE7 == pytest.approx(10_000_000, abs=2)
    assert longitude == DEFAULT_ORIGIN.longitude_degE7
    assert m.GpsGlobalOrigin(latitude, longitude, 0).latitude == latitude  # fits the field
