"""Setpoints and failsafe of ArduPilot Rover, as observed on 4.6.3.

Any mode can be entered while disarmed. Arming needs a settled estimate. In a mode that drives by
itself, the rover starts to drive as soon as it is armed.
"""

import math

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.enums import MavSeverity, MavState
from rover_sim.errors import SimulatedCrash
from rover_sim.flight import Flight
from rover_sim.modes import Mode
from rover_sim.onboard import Onboard
from rover_sim.setpoints import (
    Destination,
    Global,
    Heading,
    Local,
    Target,
    TurnRate,
    read_setpoint,
)
from rover_sim.steering import HOLD, STOP, Demand, steer_to_heading, steer_to_place

REACHED_RADIUS = 0.3  # m, around each mission item
SETPOINT_TIMEOUT = 3.0  # s, a constant in ArduPilot's mode_guided.cpp
ARRIVAL_RADIUS = 0.1  # m, of GUIDED; nearer than this the rover only brakes


class ArduPilotFlight(Flight):
    """Keeps the last target, armed or not: if armed within its time-out, the rover drives off."""

    reposition_mode = Mode.GUIDED

    def __init__(self, on: Onboard) -> None:
        super().__init__(on)
        self._taken_at = 0.0
        self._speed = math.inf  # m/s towards a place, from DO_CHANGE_SPEED
        self._heard: float | None = None  # when the ground station's last heartbeat came
        self._operator_lost = False

    @property
    def system_status(self) -> MavState:
        """MAV_STATE as Rover derives it: from failsafe and mode, not from arming."""
        if self._operator_lost:
            return MavState.CRITICAL
        if self.mode is Mode.INITIALISING:
            return MavState.CALIBRATING
        return MavState.STANDBY if self.mode is Mode.HOLD else MavState.ACTIVE

    def begin(self, mode: Mode) -> None:
        """Forget the target on entering GUIDED."""
        if mode is Mode.GUIDED:
            self.setpoint = None

    def hear_heartbeat(self, system_id: int) -> None:
        """Note a heartbeat of the ground station: setpoints are no sign of life."""
        if system_id == self.on.parameters["SYSID_MYGCS"]:
            self._heard = self.on.now

    def watch(self, *, arrived: bool) -> None:
        """Enter HOLD when the ground station's heartbeats stop, if that failsafe is enabled.

        It is off by default. A rover that never received a heartbeat does not miss them.
        """
        del arrived
        values, outbox = self.on.parameters, self.on.outbox
        lost = False
        if values["FS_GCS_ENABLE"] != 0 and self._heard is not None:
            limit = values["FS_GCS_TIMEOUT"] + values["FS_TIMEOUT"]
            lost = self.on.now - self._heard > limit
        if lost is self._operator_lost:
            return
        self._operator_lost = lost
        if not lost:
            outbox.inform("GCS Failsafe Cleared")
            return
        # Rover 4.6.3 says Radio, because the RC check shares the failsafe bits.
        outbox.say(MavSeverity.WARNING, "Radio Failsafe")
        if self.armed:
            self._switch(Mode.HOLD)

    def take(self, message: Local | Global) -> None:
        """Take a setpoint in GUIDED; drop it silently in other modes."""
        if self.mode is Mode.GUIDED:
            on = self.on
            limit = on.speed_limit
            self.go_to(read_setpoint(message, on.estimate, on.origin, speed_limit=limit))

    def go_to(self, place: Target | None) -> None:
        """Take a target; ignore None ("here"), which ArduPilot does not know."""
        if place is None:
            return
        if isinstance(place, Destination) and place != self.setpoint:
            self._speed = math.inf
        self.setpoint = place
        self._taken_at = self.on.now

    def change_speed(self, speed: float) -> bool:
        """Set the speed towards a place; return False without one, or for speed < 0."""
        if math.isnan(speed):
            raise SimulatedCrash("NaN in DO_CHANGE_SPEED: ArduPilot aborts")
        if speed < 0.0 or not isinstance(self.setpoint, Destination):
            return False
        self._speed = speed
        return self.mode is Mode.GUIDED

    def follow_setpoint(self) -> Demand:
        """Return the demand in GUIDED; the time-out also runs while disarmed."""
        match self.setpoint:
            case None:
                return STOP
            case Destination() as place:
                demand = self.steer_to(place, self._speed, ARRIVAL_RADIUS)
                if demand is not None:
                    return demand
                # The real one sends this for a guided target, too, although no mission runs.
                self.on.outbox.send(messages.MissionItemReached(0))
            case Heading() | TurnRate() if self.on.now - self._taken_at > SETPOINT_TIMEOUT:
                text = "target not received last 3secs, stopping"
                self.on.outbox.say(MavSeverity.WARNING, text)
            case Heading(yaw, speed):
                return steer_to_heading(self.on.estimate, yaw, speed)
            case TurnRate(yaw_rate, speed):
                return Demand(speed, yaw_rate)
        self.setpoint = None
        return STOP

    def steer_to(
        self, place: Destination, most: float = math.inf, radius: float = REACHED_RADIUS
    ) -> Demand | None:
        """Return the demand towards a place, by default as in AUTO and RTL; None on arrival."""
        on, pivots = self.on, self.on.persona.frame.turns_on_the_spot
        return steer_to_place(on.estimate, place, min(most, on.speed_limit), radius, pivots=pivots)

    def hold(self) -> Demand:
        """Return the demand that stops the rover; HOLD drives to no place."""
        return HOLD
