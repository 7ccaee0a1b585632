"""What drives a rover through the manoeuvres: the seam, and the set-points that it streams."""

from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True)
class Step:
    """A set-point that is streamed for some seconds, then zeros."""

    name: str
    speed: float  # m/s
    yaw_rate: float = 0.0  # rad/s, clockwise; a PX4 rover gets a velocity that turns so fast
    aside: float = 0.0  # rad from the heading: the way of the velocity, on PX4
    seconds: float = 5.0
    rest: float = 5.0  # s of zeros


class Driver(Protocol):
    """Somebody who can drive a rover by MAVLink and who records what happens."""

    @property
    def is_px4(self) -> bool:
        """Whether the rover is a PX4."""
        ...

    @property
    def is_ready(self) -> bool:
        """Whether it is armed and takes set-points."""
        ...

    @property
    def is_armed(self) -> bool:
        """Whether its last HEARTBEAT says armed."""
        ...

    @property
    def reported_speed(self) -> float:
        """The speed that it last reported, m/s."""
        ...

    def mark(self, name: str) -> None:
        """Note that a manoeuvre begins."""
        ...

    def wait(self, seconds: float) -> None:
        """Let time pass without a set-point."""
        ...

    def wait_for_rover(self) -> None:
        """Let time pass until the rover is heard."""
        ...

    def drive(self, seconds: float, step: Step) -> None:
        """Stream the step's set-point."""
        ...

    def take_control(self) -> bool:
        """Ask for the mode that takes set-points; return whether it was accepted."""
        ...

    def hold(self) -> bool:
        """Ask for the mode HOLD; return whether it was accepted."""
        ...

    def arm(self) -> bool:
        """Ask it to arm; return whether it was accepted."""
        ...

    def disarm(self) -> bool:
        """Ask it to disarm; return whether it was accepted."""
        ...

    def push_stick(self, throttle: int | None) -> None:
        """Hold the throttle stick so (µs), by RC_CHANNELS_OVERRIDE; None releases it."""
        ...
