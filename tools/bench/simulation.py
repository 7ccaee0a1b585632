"""One pybullet rover with MAVLink, driven by setpoints, compared with bare stepping."""

from itertools import count
from time import perf_counter

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.enums import MavCmd
from rover_sim.body import Pose
from rover_sim.bullet import PHYSICS_RATE, BulletBody
from rover_sim.errors import MissingExtra
from rover_sim.motion import CONTROL_PERIOD
from rover_sim.vehicle import Vehicle, make_vehicle

from .table import Row

SIMULATED = 60.0  # s
WARM_UP = 5.0  # s
SETPOINT_PERIOD = 0.05  # s
GUIDED = 15
VELOCITY_AND_RATE = 0x05C7
BODY_NED = 8
FORWARD, YAW_RATE = 0.5, 0.3  # m/s, rad/s: a circle
GOAL = 0.6


def measure() -> list[Row]:
    """Return the row of the simulation; without pybullet, rows that say so."""
    try:
        plain = _plain()
    except MissingExtra as missing:
        return [Row("simulated rover", "–", "–", "", f"≥ {GOAL:.0%}", None), _missing(missing)]
    ours = _with_mavlink()
    return [
        Row(
            "simulated rover with MAVLink",
            f"{ours:,.0f} s/s",
            f"{plain:,.0f} s/s stepSimulation",
            f"{ours / plain:.0%}",
            f"≥ {GOAL:.0%}",
            ours >= GOAL * plain,
        )
    ]


def _missing(missing: MissingExtra) -> Row:
    return Row(str(missing), "", "", "", "", None)


def _plain() -> float:
    """Return simulated seconds per second of stepSimulation at 240 Hz, with a rover on a circle."""
    body = BulletBody(start=Pose())
    try:
        import pybullet  # noqa: PLC0415 - optional

        body.drive(FORWARD, YAW_RATE)
        body.advance(1 / PHYSICS_RATE)  # sets one physics step per call
        client = body._client
        for _ in range(round(WARM_UP * PHYSICS_RATE)):
            pybullet.stepSimulation(client)
        steps = round(SIMULATED * PHYSICS_RATE)
        start = perf_counter()
        for _ in range(steps):
            pybullet.stepSimulation(client)
        return SIMULATED / (perf_counter() - start)
    finally:
        body.close()


def _with_mavlink() -> float:
    """Return simulated seconds per second of a whole vehicle, with telemetry and setpoints."""
    body = BulletBody(start=Pose())
    vehicle = make_vehicle(body, system_id=1, now=0.0)
    try:
        driver = _Driver(vehicle)
        driver.take_control()
        driver.run(WARM_UP)
        north, east = vehicle.truth.north, vehicle.truth.east
        start = perf_counter()
        driver.run(SIMULATED)
        rate = SIMULATED / (perf_counter() - start)
        if (vehicle.truth.north, vehicle.truth.east) == (north, east):
            print("simulation: the rover did not move")
        return rate
    finally:
        body.close()


class _Driver:
    """Streams setpoints to a vehicle in simulated time, and receives its telemetry."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._encoder = Encoder(Address(250, 191))
        self._ticks = count(1)
        self._heard = 0

    def take_control(self) -> None:
        """Request 20 Hz of position and attitude, GUIDED and arming."""
        self._send(m.Heartbeat(6, 8, 0, 0, 4, 3), now=0.0)
        for message_id in (m.LocalPositionNed.id, m.Attitude.id):
            self._command(MavCmd.SET_MESSAGE_INTERVAL, message_id, 1e6 * SETPOINT_PERIOD)
        self.run(WARM_UP)
        self._command(MavCmd.DO_SET_MODE, 1, GUIDED)
        self._command(MavCmd.COMPONENT_ARM_DISARM, 1)

    def run(self, seconds: float) -> None:
        """Advance by ``seconds`` in control steps, with a setpoint each SETPOINT_PERIOD."""
        steps = round(seconds / CONTROL_PERIOD)
        each = max(1, round(SETPOINT_PERIOD / CONTROL_PERIOD))
        for step in range(steps):
            now = next(self._ticks) * CONTROL_PERIOD
            if step % each == 0:
                self._send(_setpoint(), now=now)
            if step % round(1 / CONTROL_PERIOD) == 0:
                self._send(m.Heartbeat(6, 8, 0, 0, 4, 3), now=now)
            self._vehicle.handle_deadline(now=now)
            self._heard += len(self._vehicle.take_packets())

    def _command(self, command: MavCmd, param1: float, param2: float = 0.0) -> None:
        message = m.CommandLong(1, 1, command, 0, param1, param2, 0, 0, 0, 0, 0)
        self._send(message, now=next(self._ticks) * CONTROL_PERIOD)

    def _send(self, message: m.Message, *, now: float) -> None:
        self._vehicle.receive(self._encoder.encode(message), "driver", now=now)


def _setpoint() -> m.SetPositionTargetLocalNed:
    return m.SetPositionTargetLocalNed(
        0, 1, 1, BODY_NED, VELOCITY_AND_RATE, 0, 0, 0, FORWARD, 0, 0, 0, 0, 0, 0, YAW_RATE
    )
