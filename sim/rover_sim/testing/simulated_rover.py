"""A simulated rover for tests: its true state, and actions on it."""

from collections.abc import Callable
from dataclasses import replace
from math import degrees
from typing import Any

from rover_sim.actuators import output_of, wheels_of
from rover_sim.body import Pose
from rover_sim.faults import Faults
from rover_sim.manual_control import BodyByHand, turned
from rover_sim.modes import Mode
from rover_sim.personas import Persona
from rover_sim.vehicle import Vehicle

STANDS = 0.01  # m/s and rad/s


class SimulatedRover:
    """One rover. Metres, radians (clockwise from north), seconds; the truth, not telemetry."""

    def __init__(
        self, vehicle: Vehicle, body: BodyByHand, *, persona: Persona, clock: Callable[[], float]
    ) -> None:
        self._vehicle = vehicle
        self._body = body
        self._persona = persona
        self._clock = clock

    def __repr__(self) -> str:
        arming = "armed" if self.armed else "disarmed"
        return (
            f"rover {self.system_id} at {self.north:.3f} m north, {self.east:.3f} m east,"
            f" heading {self.heading:.1f} deg, {self.speed:.2f} m/s, {arming}, {self.mode}"
        )

    @property
    def system_id(self) -> int:
        """Its MAVLink system id."""
        return self._vehicle.autopilot.address.system_id

    @property
    def persona(self) -> str:
        """The persona: "ardupilot", "px4" or "generic"."""
        return self._persona.name

    @property
    def north(self) -> float:
        """Metres north of the ground frame's origin."""
        return self._body.state.north

    @property
    def east(self) -> float:
        """Metres east of the ground frame's origin."""
        return self._body.state.east

    @property
    def yaw(self) -> float:
        """Radians clockwise from north, -pi to pi."""
        return self._body.state.yaw

    @property
    def heading(self) -> float:
        """The yaw in degrees, 0 to 360."""
        return degrees(self._body.state.yaw) % 360

    @property
    def speed(self) -> float:
        """Metres per second along its heading; negative: backwards."""
        return self._body.state.forward_speed

    @property
    def yaw_rate(self) -> float:
        """Radians per second, clockwise."""
        return self._body.state.yaw_rate

    @property
    def stands(self) -> bool:
        """Whether the rover stands still."""
        return abs(self.speed) < STANDS and abs(self.yaw_rate) < STANDS

    @property
    def armed(self) -> bool:
        """Whether its motors are live."""
        return self._vehicle.autopilot.armed

    @property
    def mode(self) -> str:
        """Its mode: "guided", "hold", "manual", "auto", "rtl", "position" or "initialising"."""
        return self._vehicle.autopilot.mode.value

    # actions of a person beside the rover

    def place(
        self, *, north: float | None = None, east: float | None = None, yaw: float | None = None
    ) -> None:
        """Move the rover to a pose at once; None keeps a value. Its motion continues."""
        now = self._body.state
        self._body.place(
            Pose(
                north=now.north if north is None else north,
                east=now.east if east is None else east,
                yaw=now.yaw if yaw is None else yaw,
            )
        )

    def push(self, *, forward: float = 0.0, right: float = 0.0, turn: float = 0.0) -> None:
        """Move the rover at once by metres along its own axes, then turn it by radians."""
        now = self._body.state
        north, east = turned(forward, right, now.yaw)
        self._body.place(Pose(now.north + north, now.east + east, now.yaw + turn))

    def block_wheels(self, side: str = "all") -> None:
        """Block the wheels of one ``side``, "left" or "right", or all.

        Raise ValueError for any other side.
        """
        self._body.blocked |= wheels_of(side)

    def free_wheels(self) -> None:
        """Release the wheels."""
        self._body.blocked = frozenset()

    def freeze_output(self, name: str) -> None:
        """Freeze an output at its present value while the rover is armed, in any mode.

        "left" or "right"; an Ackermann rover has "throttle" and "steering". Raise ValueError for
        others.
        """
        frozen = self._vehicle.autopilot.faults.outputs_frozen | {
            output_of(name, self._persona.frame)
        }
        self._change_faults(outputs_frozen=frozen)

    def free_outputs(self) -> None:
        """Release every output."""
        self._change_faults(outputs_frozen=frozenset())

    def lose_gps(self) -> None:
        """Remove all satellites: after some seconds of driving, the position is lost."""
        self._change_faults(gps_lost=True)

    def regain_gps(self) -> None:
        """Restore the satellites."""
        self._change_faults(gps_lost=False)

    def arm(self) -> None:
        """Arm the rover locally, without a MAVLink command."""
        self._vehicle.autopilot.operator_arm(True, now=self._clock())

    def disarm(self) -> None:
        """Disarm the rover locally, without a MAVLink command."""
        self._vehicle.autopilot.operator_arm(False, now=self._clock())

    def set_mode(self, mode: str) -> None:
        """Turn the mode switch. Raise ValueError for a mode that this make lacks."""
        known = [each.value for each in self._persona.modes.numbers]
        if mode not in known:
            raise ValueError(f"mode must be one of {', '.join(known)}, not {mode!r}")
        self._vehicle.autopilot.operator_mode(Mode(mode), now=self._clock())

    def hold_sticks(self, *, forward: float = 0.0, yaw_rate: float = 0.0) -> None:
        """Hold the sticks of the remote control at m/s and rad/s.

        They drive in "manual"; on a realistic ArduPilot the throttle also adds speed in "guided".
        """
        self._vehicle.autopilot.operator_sticks(forward, yaw_rate)

    def reboot(self) -> None:
        """Restart the autopilot: for a second it neither receives nor sends."""
        self._vehicle.autopilot.reboot(now=self._clock())

    def set_faults(self, faults: Faults) -> None:
        """Replace the faults; ``Faults()`` clears them all."""
        self._vehicle.autopilot.set_faults(faults)

    def _change_faults(self, **changes: Any) -> None:
        self.set_faults(replace(self._vehicle.autopilot.faults, **changes))
