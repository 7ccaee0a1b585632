"""Watches every packet on its way to a rover, and the rover itself: the rules that always hold.

- no non-zero setpoint before the rover was seen armed by the server, nor while it is disarmed
- never two sources of setpoints within a time in which neither can have known of the other
- no number that is not finite in a setpoint
- after STOP no non-zero setpoint and no arm request, until somebody continues
"""

from dataclasses import dataclass, field
from math import isfinite
from typing import Any

from pymavlink.dialects.v20 import common

TWO_SOURCES = 1.0  # s between non-zero setpoints of two sources
SETPOINT = "SET_POSITION_TARGET_LOCAL_NED"


@dataclass
class Observer:
    """Sees what passes on the vehicle side of one rover; ``check`` raises what was wrong."""

    armed_seen: bool = False
    stopped: bool = False
    violations: list[str] = field(default_factory=list)
    setpoints: list[tuple[float, Any]] = field(default_factory=list)
    commands: list[tuple[float, Any]] = field(default_factory=list)
    _last_moving: tuple[float, tuple[int, int]] | None = None

    def __post_init__(self) -> None:
        self._to_rover = _parser()
        self._from_rover = _parser()

    def to_rover(self, now: float, data: bytes) -> None:
        """A datagram arrives at the rover."""
        for message in self._to_rover.parse_buffer(data) or ():
            if message.get_type() == SETPOINT:
                self.setpoints.append((now, message))
                self._check_setpoint(now, message)
            elif message.get_type() in ("COMMAND_LONG", "COMMAND_INT"):
                self.commands.append((now, message))
                if self.stopped and message.command == 400 and message.param1 != 0:
                    self._violation(now, f"arm request after STOP: {message}")

    def to_server(self, now: float, data: bytes) -> None:
        """A datagram of the rover arrives at the server."""
        del now
        for message in self._from_rover.parse_buffer(data) or ():
            if message.get_type() == "HEARTBEAT" and message.get_srcComponent() == 1:
                self.armed_seen = bool(message.base_mode & 128)

    def check(self) -> None:
        """Raise AssertionError if anything was wrong."""
        assert not self.violations, "\n".join(self.violations)

    def _check_setpoint(self, now: float, message: Any) -> None:
        values = (message.vx, message.vy, message.vz, message.yaw_rate)
        if not all(isfinite(value) for value in values):
            self._violation(now, f"setpoint not finite: {message}")
        if not any(values):
            return
        source = (message.get_srcSystem(), message.get_srcComponent())
        if not self.armed_seen:
            self._violation(now, f"moving setpoint to a rover not seen armed: {message}")
        if self.stopped:
            self._violation(now, f"moving setpoint after STOP: {message}")
        if self._last_moving is not None:
            at, before = self._last_moving
            if before != source and now - at < TWO_SOURCES:
                self._violation(now, f"two sources of setpoints: {before}, {source}")
        self._last_moving = (now, source)

    def _violation(self, now: float, text: str) -> None:
        self.violations.append(f"{now:.3f}: {text}")


def _parser() -> Any:
    parser = common.MAVLink(None)
    parser.robust_parsing = True
    return parser
