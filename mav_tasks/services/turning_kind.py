"""How a vehicle can turn, as its parameters have it: on the spot, or as a car.

ArduPilot Rover 4.6: SERVOn_FUNCTION 26 is steering, 73 and 74 are the throttles of the left and the
right side; one that has both is skid-steered. TURN_RADIUS is the least radius, m. PX4 1.15 to 1.17:
CA_AIRFRAME 5 is Ackermann, 6 differential, 13 mecanum; where that is not there the thousands of
SYS_AUTOSTART (51 Ackermann). Its least radius is RA_WHEEL_BASE over the tangent of RA_MAX_STR_ANG.
"""

from math import pi, tan

from mav_tasks.services.asked_parameters import AskedParameters
from mav_tasks.settings import DEFAULT_TURNING_RADIUS, Turning

OUTPUTS = 8  # of which a rover's steering and throttles are some
STEERING, LEFT, RIGHT = 26, 73, 74  # SERVOn_FUNCTION
FUNCTIONS = tuple(f"SERVO{number}_FUNCTION" for number in range(1, OUTPUTS + 1))
RADIUS = "TURN_RADIUS"  # m
AIRFRAME, AUTOSTART = "CA_AIRFRAME", "SYS_AUTOSTART"
BASE, ANGLE = "RA_WHEEL_BASE", "RA_MAX_STR_ANG"  # m, rad
BY_AIRFRAME = {5: Turning.STEERED, 6: Turning.ON_SPOT, 13: Turning.ON_SPOT}
BY_AUTOSTART = {50: Turning.ON_SPOT, 51: Turning.STEERED, 52: Turning.ON_SPOT}
ARDUPILOT = (*FUNCTIONS, RADIUS)
PX4 = (AIRFRAME, AUTOSTART, BASE, ANGLE)


class TurningKind(AskedParameters):
    """What is known of one vehicle's way of turning."""

    @property
    def turning(self) -> Turning | None:
        """Return how it turns; None: it has not said so."""
        values = self._values
        functions = {values.get(name) for name in FUNCTIONS}
        if functions >= {LEFT, RIGHT}:
            return Turning.ON_SPOT
        if STEERING in functions:
            return Turning.STEERED
        if AIRFRAME in values:
            return BY_AIRFRAME.get(int(values[AIRFRAME]))
        return BY_AUTOSTART.get(int(values.get(AUTOSTART, 0)) // 1000)

    @property
    def radius(self) -> float | None:
        """Return its least turning radius, m; None: no more than is taken for granted."""
        radius, angle = self._values.get(RADIUS, 0.0), self._values.get(ANGLE, 0.0)
        if BASE in self._values and 0.0 < angle < pi / 2:
            radius = self._values[BASE] / tan(angle)
        # asked for less it swings beyond: its steering takes its time (ArduPilot 4.6.3)
        return radius if radius > DEFAULT_TURNING_RADIUS else None

    def forget(self) -> None:
        """The vehicle has restarted, or is another one: it is asked again."""
        super().forget()
        self._values.clear()
