"""What all scripts upload. The classes are those of both faces of MAVSDK 4."""

from typing import Any

from mavsdk.plugins.geofence.geofence import FenceType, GeofenceData, Point, Polygon
from mavsdk.plugins.mission.mission import MissionItem, MissionPlan
from mavsdk.plugins.mission_raw.mission_raw import MissionItem as RawItem

from tests.interop.scripts.facts import METRES, NAN, Persona

SIDE = 30 / METRES  # degrees: half the side of the fence


def raw_items(home: Any) -> list[RawItem]:
    """Four, north of each other by a bit less than a metre; the first is at the home."""
    latitude, longitude = round(home.latitude_deg * 1e7), round(home.longitude_deg * 1e7)
    return [
        RawItem(n, 6, 16, int(n == 0), 1, 0, 0, 0, NAN, latitude + 80 * n, longitude, 0.0, 0)
        for n in range(4)
    ]


def places(items: list[RawItem], home: Any, persona: Persona) -> list[tuple[int, int]]:
    """Of downloaded items, the command and how far north, without a home that is the rover's."""
    latitude = round(home.latitude_deg * 1e7)
    return [(item.command, item.x - latitude) for item in items[persona.has_home_item :]]


def plan(home: Any) -> MissionPlan:
    """Two places, farther north than the raw items, so that it need not turn round.

    With a radius of their own: MAVSDK's, of 3 m, is for what flies.
    """
    return MissionPlan(
        [
            MissionItem(
                home.latitude_deg + north / METRES,
                home.longitude_deg,
                relative_altitude_m=0.0,
                speed_m_s=1.0,
                is_fly_through=True,
                acceptance_radius_m=0.3,
                camera_action=0,
                vehicle_action=0,
            )
            for north in (3.7, 5.0)
        ]
    )


def fence(home: Any) -> GeofenceData:
    """A square around the home."""
    corners = [
        Point(home.latitude_deg + north * SIDE, home.longitude_deg + east * SIDE)
        for north, east in ((1, 1), (1, -1), (-1, -1), (-1, 1))
    ]
    return GeofenceData([Polygon(corners, FenceType.INCLUSION)], [])
