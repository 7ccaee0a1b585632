"""The protocol for driving a rover through manoeuvres, and the setpoints that it streams."""

from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True)
class Step:
    """A setpoint that is streamed for some seconds, then zeros."""

    name: str
    speed: float  # m/s
    yaw_rate: float = 0.0  # rad/s, clockwise; a PX4 rover gets a velocity that turns at this rate
    aside: float = 0.0  # rad from the heading: the direction of the velocity, on PX4
    seconds: float = 5.0
    rest: float = 5.0  # s of zeros


class Driver(Protocol):
    """Drives a rover over MAVLink and records the messages."""

    @property
    def is_px4(self) -> bool:
        """Whether the rover is a PX4."""
        ...

    @property
    def is_ready(self) -> bool:
        """Whether the rover is armed and follows setpoints."""
        ...

    @property
    def is_armed(self) -> bool:
        """Whether its last HEARTBEAT says armed."""
        ...

    @property
    def reported_speed(self) -> float:
        """Speed that the rover last reported, m/s."""
        ...

    def mark(self, name: str) -> None:
        """Record the start of a manoeuvre."""
        ...

    def wait(self, seconds: float) -> None:
        """Let time pass without setpoints."""
        ...

    def wait_for_rover(self) -> None:
        """Let time pass until the rover is heard."""
        ...

    def drive(self, seconds: float, step: Step) -> None:
        """Stream the step's setpoint."""
        ...

    def take_control(self) -> bool:
        """Request the mode that follows setpoints; return whether it was accepted."""
        ...

    def hold(self) -> bool:
        """Request HOLD; return whether it was accepted."""
        ...

    def arm(self) -> bool:
        """Request arming; return whether it was accepted."""
        ...

    def disarm(self) -> bool:
        """Request disarming; return whether it was accepted."""
        ...

    def push_stick(self, throttle: int | None) -> None:
        """Hold the throttle at a pulse (µs) by RC_CHANNELS_OVERRIDE; None releases it."""
        ...
