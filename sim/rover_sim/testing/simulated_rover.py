"""A simulated rover for tests: its true state, and actions on it."""

from collections.abc import Callable
from dataclasses import replace
from math import degrees
from typing import Any

from rover_sim.actuators import output_of, wheels_of
from rover_sim.body import Pose
from rover_sim.faults import Faults
from rover_sim.modes import Mode
from rover_sim.personas import Persona
from rover_sim.vehicle import Vehicle

STANDS = 0.01  # m/s and rad/s


class SimulatedRover:
    """One rover. Metres, radians (clockwise from north), seconds; the truth, not telemetry."""

    def __init__(self, vehicle: Vehicle, *, persona: Persona, clock: Callable[[], float]) -> None:
        self._vehicle, self._autopilot = vehicle, vehicle.autopilot
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
        return self._autopilot.address.system_id

    @property
    def persona(self) -> str:
        """The persona: "ardupilot", "px4" or "generic"."""
        return self._persona.name

    @property
    def north(self) -> float:
        """Metres north of the ground frame's origin."""
        return self._vehicle.truth.north

    @property
    def east(self) -> float:
        """Metres east of the ground frame's origin."""
        return self._vehicle.truth.east

    @property
    def yaw(self) -> float:
        """Radians clockwise from north, -pi to pi."""
        return self._vehicle.truth.yaw

    @property
    def heading(self) -> float:
        """The yaw in degrees, 0 to 360."""
        return degrees(self._vehicle.truth.yaw) % 360

    @property
    def speed(self) -> float:
        """Metres per second along its heading; negative: backwards."""
        return self._vehicle.truth.forward_speed

    @property
    def stands(self) -> bool:
        """Whether the rover stands still."""
        state = self._vehicle.truth
        return abs(state.forward_speed) < STANDS and abs(state.yaw_rate) < STANDS

    @property
    def armed(self) -> bool:
        """Whether its motors are live."""
        return self._autopilot.armed

    @property
    def mode(self) -> str:
        """Its mode: "guided", "hold", "manual", "auto", "rtl", "position" or "initialising"."""
        return self._autopilot.mode.value

    # actions of a person beside the rover

    def place(
        self, *, north: float | None = None, east: float | None = None, yaw: float | None = None
    ) -> None:
        """Move the rover to a pose at once; None keeps a value. Its motion continues."""
        given = {"north": north, "east": east, "yaw": yaw}
        here = Pose(self.north, self.east, self.yaw)
        named = {name: value for name, value in given.items() if value is not None}
        self._vehicle.place(replace(here, **named))

    def push(self, *, forward: float = 0.0, right: float = 0.0, turn: float = 0.0) -> None:
        """Move the rover at once by metres along its own axes, then turn it by radians."""
        self._vehicle.push(forward, right, turn)

    def block_wheels(self, side: str = "all") -> None:
        """Block the wheels of one ``side``, "left" or "right", or all.

        Raise ValueError for any other side.
        """
        self._change(wheels_blocked=self._autopilot.faults.wheels_blocked | wheels_of(side))

    def free_wheels(self) -> None:
        """Release the wheels."""
        self._change(wheels_blocked=frozenset())

    def freeze_output(self, name: str) -> None:
        """Freeze an output at its present value while the rover is armed, in any mode.

        "left" or "right"; an Ackermann rover has "throttle" and "steering". Raise ValueError for
        others.
        """
        frozen = {output_of(name, self._persona.frame)}
        self._change(outputs_frozen=self._autopilot.faults.outputs_frozen | frozen)

    def lose_gps(self) -> None:
        """Remove all satellites: after some seconds of driving, the position is lost."""
        self._change(gps_lost=True)

    def arm(self) -> None:
        """Arm the rover locally, without a MAVLink command."""
        self._autopilot.operator_arm(True, now=self._clock())

    def disarm(self) -> None:
        """Disarm the rover locally, without a MAVLink command."""
        self._autopilot.operator_arm(False, now=self._clock())

    def set_mode(self, mode: str) -> None:
        """Turn the mode switch. Raise ValueError for a mode that this make lacks."""
        known = [each.value for each in self._persona.modes.numbers]
        if mode not in known:
            raise ValueError(f"mode must be one of {', '.join(known)}, not {mode!r}")
        self._autopilot.operator_mode(Mode(mode), now=self._clock())

    def hold_sticks(self, *, forward: float = 0.0, yaw_rate: float = 0.0) -> None:
        """Hold the sticks of the remote control at m/s and rad/s.

        They drive in "manual"; on a realistic ArduPilot the throttle also adds speed in "guided".
        """
        self._autopilot.operator_sticks(forward, yaw_rate)

    def reboot(self) -> None:
        """Restart the autopilot: for a second it neither receives nor sends."""
        self._autopilot.reboot(now=self._clock())

    def set_faults(self, faults: Faults) -> None:
        """Replace the faults; ``Faults()`` clears them all."""
        self._autopilot.set_faults(faults)

    def _change(self, **changes: Any) -> None:
        self.set_faults(replace(self._autopilot.faults, **changes))
