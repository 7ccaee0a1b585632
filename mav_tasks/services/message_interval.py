"""Rates of telemetry: thinning for one client. MAVLink guide: SET_MESSAGE_INTERVAL, and the older
REQUEST_DATA_STREAM that MAVProxy sends, QGroundControl to ArduPilot too.

The server owns the rates on the vehicle links; what a client asks for is met by leaving messages
out of what is forwarded to it.
"""

from mav_tasks.mavlink import messages as m
from mav_tasks.services.congestion_backoff import CongestionBackoff
from mav_tasks.services.interval_requester import WANTED

#: Messages that vehicles send as streams, by id: only these are thinned. Everything else is an
#: answer or an event, of which none may be lost.
STREAMED = frozenset(
    {
        m.SysStatus.id,
        m.SystemTime.id,
        m.GpsRawInt.id,
        27,  # RAW_IMU
        26,  # SCALED_IMU
        29,  # SCALED_PRESSURE
        m.Attitude.id,
        31,  # ATTITUDE_QUATERNION
        m.LocalPositionNed.id,
        m.GlobalPositionInt.id,
        35,  # RC_CHANNELS_RAW
        36,  # SERVO_OUTPUT_RAW
        m.MissionCurrent.id,
        62,  # NAV_CONTROLLER_OUTPUT
        65,  # RC_CHANNELS
        m.VfrHud.id,
        m.PositionTargetLocalNed.id,
        m.PositionTargetGlobalInt.id,
        105,  # HIGHRES_IMU
        116,  # SCALED_IMU2
        129,  # SCALED_IMU3
        132,  # DISTANCE_SENSOR
        141,  # ALTITUDE
        m.BatteryStatus.id,
        230,  # ESTIMATOR_STATUS
        241,  # VIBRATION
        331,  # ODOMETRY
    }
)

#: What REQUEST_DATA_STREAM names at once, by MAV_DATA_STREAM: as ArduPilot's rovers have it.
GROUPS: dict[int, frozenset[int]] = {
    0: STREAMED,  # ALL
    1: frozenset({26, 27, 29, 105, 116, 129}),  # RAW_SENSORS
    2: frozenset(  # EXTENDED_STATUS
        {m.SysStatus.id, m.MissionCurrent.id, m.GpsRawInt.id, 62, m.PositionTargetGlobalInt.id}
    ),
    3: frozenset({35, 36, 65}),  # RC_CHANNELS
    6: frozenset({m.GlobalPositionInt.id, m.LocalPositionNed.id}),  # POSITION
    10: frozenset({m.Attitude.id, 31}),  # EXTRA1
    11: frozenset({m.VfrHud.id}),  # EXTRA2
    12: frozenset({m.SystemTime.id, m.BatteryStatus.id, 132, 230, 241}),  # EXTRA3
}

STOPPED = -1  # SET_MESSAGE_INTERVAL param2: send no more
DEFAULT = 0  # SET_MESSAGE_INTERVAL param2: back to the default rate
LONGEST_US = 2**31 - 1  # what MESSAGE_INTERVAL can say
MAX_WISHES = 256  # of one client, for each vehicle
UNCROWDED = 0.02  # s; a wish for more is stretched as if it were for this
GOLDEN = 0.618  # multiples of it are spread evenly between whole numbers
SLACK = 0.7  # of an interval: the jitter of a stream must not halve its rate


class StreamRateLimiter:
    """Which of a vehicle's streamed messages one client gets."""

    def __init__(self, *, default_interval: float, least: float = 0.0) -> None:
        """``least``: s between messages of one type, whatever the client wishes."""
        #: s between messages that the client has no wish for
        self.default_interval = default_interval
        self._least = least
        self._intervals: dict[int, dict[int, float | None]] = {}  # by system and message
        #: whether somebody who may command wished it, by system and message: of what the vehicle
        #: itself is asked for
        self.asked: dict[int, dict[int, bool]] = {}
        self._last: dict[tuple[int, int, int], float] = {}
        self.backoff = CongestionBackoff()

    def set_interval(
        self, system_id: int, message_id: int, interval_us: float, *, commands: bool = True
    ) -> None:
        """Take a client's wish: microseconds, STOPPED or DEFAULT.

        ``commands``: whoever sent it may command vehicles, and is no observer.
        """
        self._thin(system_id, message_id, interval_us)
        self._ask(system_id, message_id, commands=commands)

    def _ask(self, system_id: int, message_id: int, *, commands: bool) -> None:
        asked = self.asked.setdefault(system_id, {})
        if message_id in self._intervals[system_id]:
            asked[message_id] = commands
        else:  # back to the default, or one wish too many
            asked.pop(message_id, None)

    def _thin(self, system_id: int, message_id: int, interval_us: float) -> None:
        wishes = self._intervals.setdefault(system_id, {})
        if interval_us == DEFAULT:
            wishes.pop(message_id, None)
        elif message_id not in wishes and len(wishes) >= MAX_WISHES:
            return
        elif interval_us < 0:
            wishes[message_id] = None
        else:
            wishes[message_id] = min(interval_us, LONGEST_US) / 1e6

    def set_group(self, system_id: int, group: int, rate: float, *, commands: bool = True) -> None:
        """Take a client's wish for a MAV_DATA_STREAM: messages a second of each kind, 0 for none.

        The latest wish for a message counts, by whatever means. The vehicle is asked only for what
        it is known to have: it says no aloud to anything else.
        """
        interval_us = 1e6 / rate if rate > 0 else STOPPED
        for message_id in GROUPS.get(group, ()):
            self._thin(system_id, message_id, interval_us)
            if message_id in WANTED:
                self._ask(system_id, message_id, commands=commands)

    def forget(self, system_id: int) -> None:
        """Forget the client's wishes for a system."""
        self._intervals.pop(system_id, None)
        self.asked.pop(system_id, None)
        self._last = {key: at for key, at in self._last.items() if key[0] != system_id}

    def interval_us(self, system_id: int, message_id: int) -> int:
        """Return the interval in force, in microseconds; STOPPED if none."""
        interval = self._interval(system_id, message_id)
        return STOPPED if interval is None else round(interval * 1e6)

    def wishes(self, system_id: int, *, commands: bool = True) -> dict[int, float]:
        """Return the intervals, in seconds by message id, that the vehicle is to be asked for.

        Those of the client where it may command, or else those of an observer.
        """
        wishes = self._intervals.get(system_id, {})
        return {
            number: interval
            for number, has in self.asked.get(system_id, {}).items()
            if has is commands and (interval := wishes.get(number)) is not None
        }

    def passes(self, system_id: int, component_id: int, message_id: int, *, now: float) -> bool:
        """Whether a message that just came is sent on to the client."""
        if message_id not in STREAMED:
            return True
        interval = self._interval(system_id, message_id)
        if interval is None:
            return False
        if not self.backoff.is_idle:
            if self.backoff.is_congested:
                return False
            interval = self._stretched(interval, message_id, now=now)
        key = (system_id, component_id, message_id)
        last = self._last.get(key)
        if last is not None and now - last < SLACK * interval:
            return False
        # keeping to the rhythm of the interval makes the long-run rate right in spite of SLACK
        self._last[key] = now if last is None else max(last + interval, now - interval)
        return True

    def _interval(self, system_id: int, message_id: int) -> float | None:
        wishes = self._intervals.get(system_id)
        default = self.default_interval
        interval = default if wishes is None else wishes.get(message_id, default)
        return None if interval is None else max(interval, self._least)

    def _stretched(self, interval: float, message_id: int, *, now: float) -> float:
        """Return the interval that the way out to the client allows.

        Slightly different ones, so that streams which waited for the end of the same congestion do
        not cause the next one by always coming together.
        """
        factor = self.backoff.factor(now=now)
        if factor == 1.0:
            return interval
        return max(interval, UNCROWDED) * factor * (0.8 + 0.4 * (message_id * GOLDEN % 1.0))
