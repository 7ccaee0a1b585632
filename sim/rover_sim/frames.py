"""How a rover steers: the geometry of its wheels."""

from enum import Enum

WHEEL_BASE = 0.4  # m between the axles, as in both URDFs
#: m, at full lock. ArduPilot's SITL rover has a turning circle of 1.8 m (and its default gains give
#: 2.9 m for 20 deg/s at 0.5 m/s); PX4's own rover drove loops of 0.8 to 0.9 m.
TURN_RADIUS = 0.9
SERVO_RATE = 5.0  # rad/s; a standard servo turns 60 degrees in 0.2 s, PX4's RA_STR_RATE_LIM is 360


class Frame(Enum):
    """The kinds of rover, as ``--frame`` names them."""

    SKID = "skid"  # ArduPilot's name for left and right wheels that are driven separately
    DIFFERENTIAL = "differential"  # PX4's name for the same
    ACKERMANN = "ackermann"  # two steered front wheels, like a car

    @property
    def turns_on_the_spot(self) -> bool:
        """Whether the rover can turn without rolling."""
        return self is not Frame.ACKERMANN
