"""What a vehicle says of itself in its parameters: how it stops, how it turns, how fast it drives.

MAVLink guide, "Parameter Protocol". A vehicle that has no such parameter stays silent: each is
asked for until it was answered, or was asked for often enough. How it stops: ``loss_failsafe``.

How it turns: ArduPilot Rover 4.6: SERVOn_FUNCTION 26 is steering, 73 and 74 are the throttles of
the left and the right side; one that has both is skid-steered. TURN_RADIUS is the least radius, m.
PX4 1.15 to 1.17: CA_AIRFRAME 5 is Ackermann, 6 differential, 13 mecanum; where that is not there
the thousands of SYS_AUTOSTART (51 Ackermann). Its least radius is RA_WHEEL_BASE over the tangent of
RA_MAX_STR_ANG.

How fast it drives where no speed is named: ArduPilot Rover 4.6: WP_SPEED, or CRUISE_SPEED where
that is 0; PX4 1.16: RO_SPEED_LIM, -1 for none.
"""

from math import isfinite, pi, tan
from struct import pack, unpack

from mav_tasks.config.settings import DEFAULT_TURNING_RADIUS, Turning
from mav_tasks.engine.services import loss_failsafe as loss
from mav_tasks.engine.services.persona import SERVO, Persona
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.messages import ParamRequestRead, ParamValue

REAL32 = 9  # MAV_PARAM_TYPE
ASKS, ASKS_FOR_LOSS = 5, 10  # times that a parameter is asked for, about once a second
STEERING, LEFT, RIGHT = 26, 73, 74  # SERVOn_FUNCTION
RADIUS = "TURN_RADIUS"  # m
AIRFRAME, AUTOSTART = "CA_AIRFRAME", "SYS_AUTOSTART"
BASE, ANGLE = "RA_WHEEL_BASE", "RA_MAX_STR_ANG"  # m, rad
BY_AIRFRAME = {5: Turning.STEERED, 6: Turning.ON_SPOT, 13: Turning.ON_SPOT}
BY_AUTOSTART = {50: Turning.ON_SPOT, 51: Turning.STEERED, 52: Turning.ON_SPOT}


class OwnParameters:
    """The parameters of one vehicle that the server reads, as far as it has said them."""

    def __init__(self, target: Address, persona: Persona) -> None:
        self._target = target
        self._persona = persona
        of_loss = loss.NAMES if persona.has_loss_failsafe else ()
        others = (*persona.turning_parameters, *persona.cruise_parameters)
        self._asks = dict.fromkeys(of_loss, ASKS_FOR_LOSS) | dict.fromkeys(others, ASKS)
        self._asks_left = dict(self._asks)  # 0: since it has started it was heard, or is silent
        self.values: dict[str, float] = {}
        self._look()

    def __repr__(self) -> str:
        return f"OwnParameters({self.values})"

    def requests(self) -> list[ParamRequestRead]:
        """Return what is to be asked now; called about once a second."""
        left = self._asks_left
        names = [name for name in left if left[name] and loss.is_asked_for(name, self.values)]
        for name in names:
            left[name] -= 1
        self._look()
        return [ParamRequestRead(*self._target, name.encode(), -1) for name in names]

    def receive(self, message: ParamValue) -> None:
        """Note the value of a parameter, also if somebody else asked for it or changed it."""
        name, value = message.param_id, float(message.param_value)
        if name not in self._asks:
            return
        if self._persona.has_bytewise_parameters and message.param_type != REAL32:
            (value,) = unpack("<i", pack("<f", value))
        if isfinite(value):
            self.values[name] = float(value)
            self._asks_left[name] = 0
            self._look()

    def forget(self) -> None:
        """Ask again, as it has restarted; until it answers it stops and drives as before."""
        self._asks_left = dict(self._asks)
        for name in self._persona.turning_parameters:  # it may be another one
            self.values.pop(name, None)
        self._look()

    def _look(self) -> None:
        """Update what follows from the values; each set-point reads it."""
        #: see ``loss_failsafe.fault_in``
        self.fault = loss.fault_in(self.values)
        #: whether it is being asked how it stops, and nobody knows that yet
        self.awaits_failsafe = any(
            self._asks_left.get(name) and name not in self.values
            for name in loss.NAMES
            if loss.is_asked_for(name, self.values)
        )

    @property
    def hides_failsafe(self) -> bool:
        """Whether it was asked how it stops, and did not say."""
        is_asked = any(map(self._asks_left.get, (loss.AFTER, loss.ACTION)))
        return self._persona.has_loss_failsafe and not (is_asked or loss.is_said(self.values))

    @property
    def turning(self) -> Turning | None:
        """How it turns; None: it has not said so."""
        values = self.values
        functions = {int(value) for name, value in values.items() if name.startswith(SERVO)}
        if {LEFT, RIGHT} <= functions:
            return Turning.ON_SPOT
        if STEERING in functions:
            return Turning.STEERED
        if AIRFRAME in values:
            return BY_AIRFRAME.get(int(values[AIRFRAME]))
        return BY_AUTOSTART.get(int(values.get(AUTOSTART, 0)) // 1000)

    @property
    def turning_radius(self) -> float | None:
        """Its least turning radius, m; None: no more than is taken for granted."""
        radius = self.values.get(RADIUS)
        if BASE in self.values and 0.0 < self.values.get(ANGLE, 0.0) < pi / 2:
            radius = self.values[BASE] / tan(self.values[ANGLE])
        # asked for less it swings beyond: its steering takes its time (ArduPilot 4.6.3)
        return radius if radius is not None and radius > DEFAULT_TURNING_RADIUS else None

    @property
    def cruise_speed(self) -> float | None:
        """The least of the speeds that the vehicle names, m/s; None if it names none."""
        speeds = map(self.values.get, self._persona.cruise_parameters)
        return min((speed for speed in speeds if speed and speed > 0.0), default=None)
