"""Heartbeats: watching a vehicle's, and our own. MAVLink guide, "Heartbeat/Connection"."""

from functools import cache

from mav_tasks.mavlink.enums import MavAutopilot, MavModeFlag, MavState, MavType
from mav_tasks.mavlink.messages import Heartbeat

INTERVAL = 1.0  # s, MAVLink guide


def kind_of(heartbeat: Heartbeat) -> tuple[int, int]:
    """Return what tells one kind of vehicle from another."""
    return heartbeat.type, heartbeat.autopilot


class HeartbeatMonitor:
    """What a vehicle's heartbeats say, and whether they still come."""

    def __init__(self, first: Heartbeat, *, lost_after: float, now: float) -> None:
        #: s of silence after which it is not heard any more
        self.lost_after = lost_after
        self.receive(first, now=now)

    def __repr__(self) -> str:
        return f"HeartbeatMonitor(mode={self.custom_mode}, armed={self.armed})"

    @property
    def custom_mode(self) -> int:
        """The autopilot's own mode number."""
        return int(self.latest.custom_mode)

    @property
    def may_be_armed(self) -> bool:
        """Whether it said that it is armed, though it may have restarted since."""
        return bool(self.latest.base_mode & MavModeFlag.SAFETY_ARMED)

    def receive(self, heartbeat: Heartbeat, *, now: float) -> None:
        self.latest = heartbeat
        #: whether the vehicle says that it is armed
        self.armed = self.may_be_armed
        self.heard_at = now

    def restarted(self) -> None:
        """It has restarted, and a restart disarms, whatever it has said before."""
        self.armed = False

    def is_heard(self, *, now: float) -> bool:
        return now - self.heard_at <= self.lost_after


class HeartbeatSender:
    """The rhythm of heartbeats that we send: the first at once, then one a second."""

    def __init__(self, *, now: float) -> None:
        self._next_at = now

    def next_deadline(self) -> float:
        return self._next_at

    def is_due(self, *, now: float) -> bool:
        """Whether one is to be sent now; plans the next, without a burst after a late wake-up."""
        if now < self._next_at:
            return False
        self._next_at = max(self._next_at + INTERVAL, now + 0.5 * INTERVAL)
        return True


@cache
def gcs_heartbeat() -> Heartbeat:
    """Return what the server says of itself on vehicle links: a ground station."""
    return Heartbeat(MavType.GCS, MavAutopilot.INVALID, 0, 0, MavState.ACTIVE, 3)


@cache
def component_heartbeat(state: MavState) -> Heartbeat:
    """Return what the task server's component inside a vehicle's system says to clients.

    Autopilot INVALID and base_mode 0, because MAVSDK takes flight mode and autopilot type from any
    component that says more.
    """
    return Heartbeat(MavType.ONBOARD_CONTROLLER, MavAutopilot.INVALID, 0, 0, state, 3)
