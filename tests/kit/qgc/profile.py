"""The differences between QGroundControl versions in use."""

from dataclasses import dataclass

HOME_POSITION, EXTENDED_SYS_STATE = 242, 245


@dataclass(frozen=True, slots=True)
class Profile:
    """One version; times in seconds."""

    name: str
    ack_timeout: float  # [2.2]; checked each half second
    restarts_timer: bool  # a repeated command gets the whole time again; [11.1]: 4.x does not
    in_progress: str  # [2.4]: "restarts" the time, or is "kept" pending
    asks_protocol_version: bool  # [1.3]: of PX4 and generic; no answer: MAVLink 1
    asks_modes: bool  # [1.3] AVAILABLE_MODES
    asks_gimbals: bool  # [1.3] of each component; [11.1]: 4.x does not
    checks_hash: bool  # [1.4] PX4's _HASH_CHECK before the list; [11.1]: 4.x does not
    hears_mavlink1: bool  # [1.1]: master ignores MAVLink 1 except heartbeats
    streams_at_once: bool  # [1.2] ArduPilot's data streams; [11.3]: 4.x one each half second
    intervals: tuple[int, ...]  # [1.2], [11.3]: requested from ArduPilot at 1 Hz
    sets_item_by_command: bool  # [2.5], [11.4]


V4 = Profile(
    name="v4",
    ack_timeout=3.0,
    restarts_timer=False,
    in_progress="kept",
    asks_protocol_version=True,
    asks_modes=False,
    asks_gimbals=False,
    checks_hash=False,
    hears_mavlink1=True,
    streams_at_once=False,
    intervals=(HOME_POSITION,),
    sets_item_by_command=False,
)
MASTER = Profile(
    name="master",
    ack_timeout=1.2,
    restarts_timer=True,
    in_progress="restarts",
    asks_protocol_version=False,
    asks_modes=True,
    asks_gimbals=True,
    checks_hash=True,
    hears_mavlink1=False,
    streams_at_once=True,
    intervals=(HOME_POSITION, EXTENDED_SYS_STATE),
    sets_item_by_command=True,
)
