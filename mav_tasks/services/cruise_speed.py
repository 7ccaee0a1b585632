"""The speed at which a vehicle itself drives where no speed is named, as its parameters have it.

ArduPilot Rover 4.6: WP_SPEED, or CRUISE_SPEED where that is 0; PX4 1.16: RO_SPEED_LIM, -1 for none.
"""

from mav_tasks.services.asked_parameters import AskedParameters


class CruiseSpeed(AskedParameters):
    """What is known of one vehicle's speed, m/s."""

    @property
    def speed(self) -> float | None:
        """The least of the speeds that the vehicle names, None if it names none."""
        return min((value for value in self._values.values() if value > 0.0), default=None)
