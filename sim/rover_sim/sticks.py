"""The remote control: the transmitter's channels, and RC_CHANNELS_OVERRIDE on top of them.

ArduPilot Rover uses the throttle in GUIDED, too: the rover drives at the speed of the stick or of
the setpoint, whichever is larger (its mode.cpp, calc_speed_nudge). Channels are in microseconds.
"""

from dataclasses import replace

from mav_tasks.mavlink import messages
from rover_sim.onboard import Onboard
from rover_sim.steering import MAX_YAW_RATE, Demand

STEERING, THROTTLE = 0, 2  # channels 1 and 3
COUNT = 8  # channels
NEUTRAL, REACH = 1500, 500  # µs
ALL_NEUTRAL = (NEUTRAL,) * COUNT
DEAD_ZONE = 30  # µs, RCn_DZ
NO_CHANGE, RELEASED = 65535, 0  # in RC_CHANNELS_OVERRIDE
OVERRIDE_TIME = 3.0  # s, RC_OVERRIDE_TIME; then the transmitter applies again
DEFAULT_TOP_SPEED = 4.0  # m/s at full throttle: SITL's rover-skid, 3 m/s at 75 %


class Sticks:
    """The present RC channels."""

    def __init__(self, on: Onboard) -> None:
        self._on = on
        top_speed = on.realism.stick_speed
        self._top_speed = DEFAULT_TOP_SPEED if top_speed is None else top_speed
        self._adds_speed = top_speed is not None
        self._held = ALL_NEUTRAL
        self._override: dict[int, int] = {}  # by channel
        self._overridden_at = float("-inf")
        self.is_there = self._adds_speed  # ArduPilot has receiver values even without one

    def hold(self, forward_speed: float, yaw_rate: float) -> None:
        """Hold the transmitter's sticks at this demand, m/s and rad/s."""
        throttle, steering = forward_speed / self._top_speed, yaw_rate / MAX_YAW_RATE
        self.hold_pulses(_pulse(throttle), _pulse(steering))

    def hold_pulses(self, throttle: int, steering: int) -> None:
        """Hold the transmitter's sticks at these pulses, µs."""
        self.is_there = True
        held = list(self._held)
        held[THROTTLE], held[STEERING] = throttle, steering
        self._held = tuple(held)

    def take_override(self, message: messages.RcChannelsOverride) -> None:
        """Override channels, or release them; PX4 takes none."""
        if not self._adds_speed:
            return
        self._overridden_at = self._on.now
        for channel in range(COUNT):
            value = getattr(message, f"chan{channel + 1}_raw")
            if value == RELEASED:
                self._override.pop(channel, None)
            elif value != NO_CHANGE:
                self._override[channel] = value

    def channels(self, now: float) -> tuple[int, ...]:
        """Return the pulses of the first eight channels, µs."""
        if not self._override:
            return self._held
        if now - self._overridden_at > OVERRIDE_TIME:
            self._override.clear()
        return tuple(self._override.get(n, held) for n, held in enumerate(self._held))

    def demand(self) -> Demand:
        """Return the sticks' demand in MANUAL."""
        channels = self.channels(self._on.now)
        speed = _part(channels[THROTTLE]) * self._top_speed
        return Demand(speed, _part(channels[STEERING]) * MAX_YAW_RATE)

    def arming_refusal(self) -> str | None:
        """Return the text that refuses arming, in ArduPilot's words (4.6.3), or None."""
        is_refused = self._adds_speed and self.demand().speed != 0.0
        return "Arm: Throttle (RC3) is not neutral" if is_refused else None

    def nudged(self, demand: Demand) -> Demand:
        """Return the demand of a velocity setpoint in GUIDED, raised by the throttle stick."""
        if not self._adds_speed:
            return demand
        larger = min if demand.speed < 0.0 else max
        return replace(demand, speed=larger(demand.speed, self.demand().speed))


def _part(pulse: int) -> float:
    """Return a stick's deflection beyond its dead zone, -1..1."""
    off = pulse - NEUTRAL
    if abs(off) <= DEAD_ZONE:
        return 0.0
    part = (abs(off) - DEAD_ZONE) / (REACH - DEAD_ZONE)
    return min(part, 1.0) if off > 0 else -min(part, 1.0)


def _pulse(part: float) -> int:
    """Return the pulse for a stick's deflection, -1..1."""
    if part == 0.0:
        return NEUTRAL
    off = round(DEAD_ZONE + min(abs(part), 1.0) * (REACH - DEAD_ZONE))
    return NEUTRAL + off if part > 0 else NEUTRAL - off
