from mav_tasks.mavlink.enums import MavAutopilot, MavModeFlag, MavState, MavType
from mav_tasks.mavlink.messages import Heartbeat
from mav_tasks.services.heartbeat import (
    HeartbeatMonitor,
    HeartbeatSender,
    component_heartbeat,
    gcs_heartbeat,
)


def heartbeat(*, armed: bool = False, mode: int = 4, autopilot: int = 3) -> Heartbeat:
    flags = MavModeFlag.CUSTOM_MODE_ENABLED | (MavModeFlag.SAFETY_ARMED if armed else 0)
    return Heartbeat(MavType.GROUND_ROVER, autopilot, int(flags), mode, MavState.ACTIVE, 3)


def test_a_vehicle_is_heard_until_its_heartbeats_stay_away() -> None:
    monitor = HeartbeatMonitor(heartbeat(), lost_after=3.0, now=10.0)
    assert [monitor.is_heard(now=now) for now in (10.0, 13.0, 13.001)] == [True, True, False]
    monitor.receive(heartbeat(), now=20.0)
    assert monitor.is_heard(now=22.0)


def test_the_latest_heartbeat_counts() -> None:
    monitor = HeartbeatMonitor(heartbeat(), lost_after=3.0, now=0.0)
    assert (monitor.armed, monitor.custom_mode) == (False, 4)
    monitor.receive(heartbeat(armed=True, mode=15), now=1.0)
    assert (monitor.armed, monitor.custom_mode) == (True, 15)


def test_heartbeats_go_out_at_once_and_then_each_second() -> None:
    sender = HeartbeatSender(now=5.0)
    sent = [n / 8 for n in range(40, 80) if sender.is_due(now=n / 8)]
    assert sent == [5.0, 6.0, 7.0, 8.0, 9.0]
    assert sender.next_deadline() == 10.0


def test_a_late_wake_up_makes_no_burst_of_heartbeats() -> None:
    sender = HeartbeatSender(now=0.0)
    assert [sender.is_due(now=now) for now in (0.0, 7.3, 7.3, 7.7)] == [True, True, False, False]


def test_towards_vehicles_the_server_is_a_ground_station() -> None:
    message = gcs_heartbeat()
    assert (message.type, message.autopilot, message.base_mode) == (
        MavType.GCS,
        MavAutopilot.INVALID,
        0,
    )


def test_the_component_says_neither_mode_nor_autopilot() -> None:
    message = component_heartbeat(MavState.ACTIVE)
    assert (message.type, message.autopilot, message.base_mode, message.custom_mode) == (
        MavType.ONBOARD_CONTROLLER,
        MavAutopilot.INVALID,
        0,
        0,
    )
    assert message.system_status == MavState.ACTIVE
