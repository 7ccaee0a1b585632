"""A simulated rover in a test's hands: where it truly is, and what can happen to it."""

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
        """Whose ways it has: "ardupilot", "px4" or "generic"."""
        return self._persona.name

    @property
    def north(self) -> float:
        """Metres from where the ground's frame begins."""
        return self._body.state.north

    @property
    def east(self) -> float:
        """Metres from where the ground's frame begins."""
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
        """Whether it moves no more."""
        return abs(self.speed) < STANDS and abs(self.yaw_rate) < STANDS

    @property
    def armed(self) -> bool:
        """Whether its motors are live."""
        return self._vehicle.autopilot.armed

    @property
    def mode(self) -> str:
        """Its mode: "guided", "hold", "manual", "auto", "rtl", "position" or "initialising"."""
        return self._vehicle.autopilot.mode.value

    # what somebody beside it does

    def place(
        self, *, north: float | None = None, east: float | None = None, yaw: float | None = None
    ) -> None:
        """Carry it somewhere at once; None: as it is. If it drives, it drives on from there."""
        now = self._body.state
        self._body.place(
            Pose(
                north=now.north if north is None else north,
                east=now.east if east is None else east,
                yaw=now.yaw if yaw is None else yaw,
            )
        )

    def push(self, *, forward: float = 0.0, right: float = 0.0, turn: float = 0.0) -> None:
        """Move it at once by so many metres as it sees it, then turn it by so many radians."""
        now = self._body.state
        north, east = turned(forward, right, now.yaw)
        self._body.place(Pose(now.north + north, now.east + east, now.yaw + turn))

    def block_wheels(self, side: str = "all") -> None:
        """Hold its wheels, or those of one ``side``, "left" or "right": whatever is asked of them,
        they stand. ValueError for anything else.
        """
        self._body.blocked |= wheels_of(side)

    def free_wheels(self) -> None:
        """Let go of its wheels."""
        self._body.blocked = frozenset()

    def freeze_output(self, name: str) -> None:
        """Let an output stay as it is, as long as the rover is armed, whatever mode it is in.

        "left" or "right"; an Ackermann rover has "throttle" and "steering". ValueError for others.
        """
        frozen = self._vehicle.autopilot.faults.outputs_frozen | {
            output_of(name, self._persona.frame)
        }
        self._change_faults(outputs_frozen=frozen)

    def free_outputs(self) -> None:
        """Let every output follow again."""
        self._change_faults(outputs_frozen=frozenset())

    def lose_gps(self) -> None:
        """Take its satellites away: it drives on for some seconds, then its position is gone."""
        self._change_faults(gps_lost=True)

    def regain_gps(self) -> None:
        """Give its satellites back."""
        self._change_faults(gps_lost=False)

    def arm(self) -> None:
        """Arm it at the rover, past everybody."""
        self._vehicle.autopilot.operator_arm(True, now=self._clock())

    def disarm(self) -> None:
        """Disarm it at the rover, past everybody."""
        self._vehicle.autopilot.operator_arm(False, now=self._clock())

    def set_mode(self, mode: str) -> None:
        """Turn its mode switch; ValueError for a mode that this make does not have."""
        known = [each.value for each in self._persona.modes.numbers]
        if mode not in known:
            raise ValueError(f"mode must be one of {', '.join(known)}, not {mode!r}")
        self._vehicle.autopilot.operator_mode(Mode(mode), now=self._clock())

    def hold_sticks(self, *, forward: float = 0.0, yaw_rate: float = 0.0) -> None:
        """Hold the sticks of its remote control so, m/s and rad/s.

        Heeded in "manual"; a rover as unkind as a real ArduPilot adds the throttle in "guided".
        """
        self._vehicle.autopilot.operator_sticks(forward, yaw_rate)

    def reboot(self) -> None:
        """Switch its autopilot off and on: a second in which it neither hears nor says anything."""
        self._vehicle.autopilot.reboot(now=self._clock())

    def set_faults(self, faults: Faults) -> None:
        """Break what ``faults`` names and mend all else; ``Faults()`` mends everything."""
        self._vehicle.autopilot.set_faults(faults)

    def _change_faults(self, **changes: Any) -> None:
        self.set_faults(replace(self._vehicle.autopilot.faults, **changes))
