"""What the streams of telemetry bring when a rover has driven a metre north, for both faces."""

from math import isfinite
from typing import Any

from tests.interop.scripts.facts import OFFBOARD, Persona

STREAMS = (
    "position",
    "velocity_ned",
    "position_velocity_ned",
    "attitude_euler",
    "heading",
    "battery",
    "flight_mode",
    "in_air",
    "armed",
    "landed_state",
    "health",
    "health_all_ok",
    "gps_info",
    "home",
    "status_text",
)


def is_told_of_a_task(texts: list[Any]) -> bool:
    """Whether any text is of a task."""
    return any(each.text.startswith("Task ") for each in texts)


def tell(heard: dict[str, list[Any]], persona: Persona, home: Any) -> None:
    """Hold the last of each against what it must be, and print which ones have come."""
    last = {name: values[-1] for name, values in heard.items()}
    assert abs(last["position"].longitude_deg - home.longitude_deg) < 3e-6
    assert max(each.north_m_s for each in heard["velocity_ned"]) > 0.3
    north = [each.position.north_m for each in heard["position_velocity_ned"]]
    assert 0.7 < north[-1] - north[0] < 1.3
    assert abs(last["attitude_euler"].yaw_deg) < 10
    assert isfinite(last["heading"].heading_deg)
    assert 0 < last["battery"].remaining_percent <= 100
    assert OFFBOARD in heard["flight_mode"]
    assert last["in_air"] is persona.is_in_air_armed
    assert last["armed"] is True
    assert last["health_all_ok"] is True
    assert last["health"].is_global_position_ok
    assert last["health"].is_home_position_ok
    assert last["gps_info"].num_satellites > 5
    assert last["home"].latitude_deg == home.latitude_deg
    assert is_told_of_a_task(heard["status_text"])
    print("heard", *heard)
