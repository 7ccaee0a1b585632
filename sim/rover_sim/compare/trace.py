"""Record of a drive through the manoeuvres: sent and received messages, and true poses."""

import itertools
import math
from bisect import bisect_left, bisect_right
from dataclasses import dataclass, field
from typing import Any, NamedTuple


class Span(NamedTuple):
    """A time interval, s."""

    begin: float
    end: float


class Heard(NamedTuple):
    """A MAVLink message with the time at which it was received or sent."""

    time: float  # s
    message: Any  # its fields are attributes, in MAVLink's units


@dataclass(frozen=True, slots=True)
class TruePose:
    """True pose of the rover: metres and radians, relative to its start."""

    time: float  # s
    north: float
    east: float
    yaw: float
    speed: float  # m/s along the heading
    yaw_rate: float  # rad/s


class Mark(NamedTuple):
    """The start of a manoeuvre."""

    time: float
    name: str


@dataclass(slots=True)
class Trace:
    """One drive through the manoeuvres. Each list is in order of time."""

    poses: list[TruePose] = field(default_factory=list)
    heard: dict[str, list[Heard]] = field(default_factory=dict)
    sent: dict[str, list[Heard]] = field(default_factory=dict)
    marks: list[Mark] = field(default_factory=list)

    def __repr__(self) -> str:
        return f"Trace({len(self.marks)} marks, {len(self.poses)} poses)"

    @property
    def is_px4(self) -> bool:
        """Whether the rover identifies itself as PX4."""
        return bool(self.heard["HEARTBEAT"][0].message.autopilot == 12)  # MAV_AUTOPILOT_PX4

    @property
    def first_heard(self) -> float:
        """Time of the rover's first message."""
        return min(rows[0].time for rows in self.heard.values())

    @property
    def whole(self) -> Span:
        """The interval from the first mark to the last."""
        return Span(self.marks[0].time, self.marks[-1].time)

    def span(self, mark: str) -> Span | None:
        """Return the interval from the first such mark to the next one; None: not driven."""
        for this, following in zip(self.marks, self.marks[1:], strict=False):
            if this.name == mark:
                return Span(this.time, following.time)
        return None

    def messages(self, name: str, span: Span | None = None) -> list[Heard]:
        """Return the messages of that name that came within the span."""
        return _within(self.heard.get(name, []), span)

    def requests(self, name: str, span: Span | None = None) -> list[Heard]:
        """Return the messages of that name that were sent within the span."""
        return _within(self.sent.get(name, []), span)

    def true_poses(self, span: Span) -> list[TruePose]:
        """Return the true poses within the span."""
        first = bisect_left(self.poses, span.begin, key=_pose_time)
        return self.poses[first : bisect_right(self.poses, span.end, key=_pose_time)]

    def texts(self, span: Span) -> list[str]:
        """Return the status texts within the span, in order."""
        return [str(each.message.text).strip() for each in self.messages("STATUSTEXT", span)]


def _pose_time(pose: TruePose) -> float:
    return pose.time


def _within(rows: list[Heard], span: Span | None) -> list[Heard]:
    if span is None:
        return rows
    first = bisect_left(rows, span.begin, key=_row_time)
    return rows[first : bisect_right(rows, span.end, key=_row_time)]


def _row_time(row: Heard) -> float:
    return row.time


def path_length(poses: list[TruePose]) -> float:
    """Return the metres driven along the poses."""
    return sum(
        math.dist((a.north, a.east), (b.north, b.east)) for a, b in itertools.pairwise(poses)
    )
