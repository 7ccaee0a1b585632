"""When each telemetry message is due: one interval per message, as in SET_MESSAGE_INTERVAL.

MAVLink guide, "Message Interval"; REQUEST_DATA_STREAM sets the same intervals by group.
"""

from collections.abc import Mapping
from dataclasses import dataclass

OFF = 0.0
NEVER = float("inf")
LONGEST_TOLD = 2**31 - 1  # µs, the limit of MESSAGE_INTERVAL
JITTER = 1e-6  # s; clock readings are not exact multiples of an interval
ALL_STREAMS = 0  # MAV_DATA_STREAM


@dataclass(frozen=True, slots=True)
class StreamTable:
    """One make's default streams."""

    intervals: Mapping[int, float]  # s, by message id; OFF: only on request
    shortest_interval: float  # s; shorter ones are refused
    groups: Mapping[int, tuple[int, ...]]  # what REQUEST_DATA_STREAM sets, by MAV_DATA_STREAM


class Streams:
    """The interval and next due time of each message. One set for the whole link."""

    def __init__(self, table: StreamTable, now: float) -> None:
        self._table = table
        self._intervals = dict(table.intervals)
        self._due = {
            message_id: NEVER if interval == OFF else now
            for message_id, interval in table.intervals.items()
        }
        self._next = now  # least of _due: most control steps check nothing else

    def interval_us(self, message_id: int) -> int:
        """Return the interval for MESSAGE_INTERVAL: -1 off, 0 not available."""
        interval = self._intervals.get(message_id)
        if interval is None:
            return 0
        return -1 if interval == OFF else round(min(interval * 1e6, LONGEST_TOLD))

    def set_interval(self, message_id: int, interval_us: float, now: float) -> bool:
        """Set the interval in µs; 0 is the default, -1 off. Return False if refused."""
        if message_id not in self._intervals:
            return False
        interval = interval_us * 1e-6
        if interval_us == 0:
            interval = self._table.intervals[message_id]
        elif interval_us == -1:
            interval = OFF
        elif not interval >= self._table.shortest_interval:  # NaN fails, too
            return False
        self._set(message_id, interval, now)
        return True

    def set_group(self, group: int, rate: float, now: float) -> None:
        """Set a whole group's rate in Hz; 0 switches it off."""
        interval = max(1.0 / rate, self._table.shortest_interval) if rate > 0 else OFF
        for number, members in self._table.groups.items():
            if group in (number, ALL_STREAMS):
                for message_id in members:
                    self._set(message_id, interval, now)

    def take_due(self, now: float) -> list[int]:
        """Return the ids that are due, and set the next due time of each."""
        horizon = now + JITTER
        if horizon < self._next:
            return []
        due = [message_id for message_id, at in self._due.items() if at <= horizon]
        for message_id in due:
            following = self._due[message_id] + self._intervals[message_id]
            # Late by more than an interval: continue from now rather than send a burst.
            late = following <= now
            self._due[message_id] = now + self._intervals[message_id] if late else following
        self._next = min(self._due.values())
        return due

    def _set(self, message_id: int, interval: float, now: float) -> None:
        self._intervals[message_id] = interval
        self._due[message_id] = NEVER if interval == OFF else now
        self._next = min(self._due.values())
