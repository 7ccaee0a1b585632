"""Views of the messages for viewers: poses, places, setpoints and texts.

Rovers are drawn as the autopilot (component 1) reports them. MAVLink's axes are north, east, down,
and for the rover itself forward, right, down; a viewer's are east, north, up, and forward, left,
up.
"""

from collections.abc import Iterator, Mapping
from math import cos, isfinite, pi, sin
from typing import Any, NamedTuple

from mav_tasks.engine.services.statustext import Text, TextReceiver
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.enums import MavFrame, MavSeverity, PositionTargetTypemask
from mav_tasks.mavlink.messages import Message
from mav_tasks.recording.mcap_export import convention, schemas
from mav_tasks.recording.mcap_export.schemas import Schema
from mav_tasks.store.rendering import clean

ATTITUDE_COUNTS = 1_000_000_000  # ns, for which a pose is drawn with the last attitude
SECOND = 1_000_000_000  # ns
FIX_2D = 2  # GPS_FIX_TYPE; less is no fix
UNKNOWN, APPROXIMATED = 0, 1  # kinds of covariance

_LEVELS = {
    MavSeverity.EMERGENCY: 5,
    MavSeverity.ALERT: 5,
    MavSeverity.CRITICAL: 5,
    MavSeverity.ERROR: 4,
    MavSeverity.WARNING: 3,
    MavSeverity.NOTICE: 2,
    MavSeverity.INFO: 2,
    MavSeverity.DEBUG: 1,
}

_FRAMES = {frame.value: frame.name for frame in MavFrame}

_T = PositionTargetTypemask
_IGNORED = {
    "x": _T.X_IGNORE,
    "y": _T.Y_IGNORE,
    "z": _T.Z_IGNORE,
    "vx": _T.VX_IGNORE,
    "vy": _T.VY_IGNORE,
    "vz": _T.VZ_IGNORE,
    "afx": _T.AX_IGNORE,
    "afy": _T.AY_IGNORE,
    "afz": _T.AZ_IGNORE,
    "yaw": _T.YAW_IGNORE,
    "yaw_rate": _T.YAW_RATE_IGNORE,
}


class Seen(NamedTuple):
    """A value for a channel; ``time`` is in nanoseconds since 1970."""

    topic: str
    schema: Schema
    time: int
    values: Mapping[str, Any]


class Views:
    """Derives values for viewers from messages in the order of their times."""

    def __init__(self) -> None:
        self._attitudes: dict[int, tuple[int, m.Attitude]] = {}
        self._texts = TextReceiver()

    def __repr__(self) -> str:
        return f"Views({len(self._attitudes)} rovers, {self._texts})"

    def of(self, message: Message, source: Address, *, time: int) -> Iterator[Seen]:
        """Yield what a message of ``source`` shows, and the texts that are complete by then."""
        if time / SECOND >= self._texts.next_deadline():
            yield from self._given_up(time)
        match message:
            case m.Statustext():
                for text in self._texts.receive(source, message, now=time / SECOND):
                    yield _log_of(text, time)
            case m.SetPositionTargetLocalNed():
                yield _setpoint_of(message, source, time)
            case _ if source.component_id == AUTOPILOT:
                yield from self._of_rover(message, source.system_id, time)

    def rest(self, *, time: int) -> Iterator[Seen]:
        """Yield the texts that never became complete."""
        for text in self._texts.handle_deadline(now=float("inf")):
            yield _log_of(text, time)

    def _given_up(self, time: int) -> Iterator[Seen]:
        for text in self._texts.handle_deadline(now=time / SECOND):
            yield _log_of(text, time)

    def _of_rover(self, message: Message, rover: int, time: int) -> Iterator[Seen]:
        match message:
            case m.Attitude():
                self._attitudes[rover] = time, message
            case m.LocalPositionNed():
                since, attitude = self._attitudes.get(rover, (time, None))
                if attitude is not None and 0 <= time - since <= ATTITUDE_COUNTS:
                    yield from _pose_of(message, attitude, rover, time)
            case m.GlobalPositionInt() if message.lat or message.lon:  # 0, 0: not known
                yield _location_of(message, rover, time, what="location")
            case m.GpsRawInt() if message.fix_type >= FIX_2D:
                yield _location_of(message, rover, time, what="gps", **_accuracy_of(message))


def timestamp(time: int) -> dict[str, int]:
    """Return nanoseconds since 1970 in Foxglove's form."""
    sec, nsec = divmod(time, SECOND)
    return {"sec": sec, "nsec": nsec}


def log(topic: str, time: int, *, level: int, name: str, words: str) -> Seen:
    """Return a text as foxglove.Log."""
    values = {
        "timestamp": timestamp(time),
        "level": level,
        "message": words,
        "name": name,
        "file": "",
        "line": 0,
    }
    return Seen(topic, schemas.LOG, time, values)


def _log_of(text: Text, time: int) -> Seen:
    level, name = _LEVELS[text.severity], str(text.sender)
    return log(convention.TEXTS, time, level=level, name=name, words=clean(text.words).strip())


def _setpoint_of(message: m.SetPositionTargetLocalNed, source: Address, time: int) -> Seen:
    frame = message.coordinate_frame
    values: dict[str, Any] = {
        "timestamp": timestamp(time),
        "frame": _FRAMES.get(frame, str(frame)),
    }
    for name, ignored in _IGNORED.items():
        value = getattr(message, name)
        is_set = not message.type_mask & ignored and isfinite(value)
        values[name] = value if is_set else None
    topic = convention.setpoint_topic(message.target_system, source)
    return Seen(topic, schemas.SETPOINT, time, values)


def _pose_of(
    position: m.LocalPositionNed, attitude: m.Attitude, rover: int, time: int
) -> Iterator[Seen]:
    numbers = (position.x, position.y, position.z, attitude.roll, attitude.pitch, attitude.yaw)
    if not all(map(isfinite, numbers)):
        return
    north, east, down, roll, pitch, yaw = numbers
    pose = {
        "position": {"x": east, "y": north, "z": 0.0 - down},
        "orientation": _quaternion(roll, -pitch, pi / 2 - yaw),
    }
    values = {"timestamp": timestamp(time), "frame_id": f"rover/{rover}/local", "pose": pose}
    yield Seen(convention.rover_topic(rover, "pose"), schemas.POSE, time, values)


def _quaternion(roll: float, pitch: float, yaw: float) -> dict[str, float]:
    """Return the rotation by yaw about z, then pitch about y, then roll about x."""
    cr, sr = cos(roll / 2), sin(roll / 2)
    cp, sp = cos(pitch / 2), sin(pitch / 2)
    cy, sy = cos(yaw / 2), sin(yaw / 2)
    return {
        "x": sr * cp * cy - cr * sp * sy,
        "y": cr * sp * cy + sr * cp * sy,
        "z": cr * cp * sy - sr * sp * cy,
        "w": cr * cp * cy + sr * sp * sy,
    }


def _location_of(
    message: m.GlobalPositionInt | m.GpsRawInt,
    rover: int,
    time: int,
    *,
    what: str,
    variances: tuple[float, float] = (0.0, 0.0),
    certainty: int = UNKNOWN,
) -> Seen:
    """``variances``: horizontal and vertical, m^2."""
    across, up = variances
    values = {
        "timestamp": timestamp(time),
        "frame_id": f"rover/{rover}",
        "latitude": message.lat / 1e7,
        "longitude": message.lon / 1e7,
        "altitude": message.alt / 1e3,
        "position_covariance": [across, 0.0, 0.0, 0.0, across, 0.0, 0.0, 0.0, up],
        "position_covariance_type": certainty,
    }
    return Seen(convention.rover_topic(rover, what), schemas.LOCATION, time, values)


def _accuracy_of(message: m.GpsRawInt) -> dict[str, Any]:
    """Return the variances of a GPS_RAW_INT, if it names its accuracy (mm)."""
    if not message.h_acc or not message.v_acc:
        return {}
    variances = ((message.h_acc / 1e3) ** 2, (message.v_acc / 1e3) ** 2)
    return {"variances": variances, "certainty": APPROXIMATED}
