"""The differences between makes of autopilot, as data: ``assets/ardupilot.toml`` and ``px4.toml``.

``ardupilot`` is Rover 4.6.3 as observed on the wire; ``px4`` is a rover on PX4 1.17, from its
sources and as observed; ``generic`` speaks as PX4 does. Only flight and drive train are code of
their own (``stack``); no code tests a persona's name.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, is_dataclass, replace
from enum import Enum
from functools import cache
from itertools import repeat
from pathlib import Path
from types import UnionType
from typing import Any, cast, get_args, get_origin, get_type_hints

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.enums import MavAutopilot, MavCmd, MavLandedState, MavResult
from rover_sim.boot import BootScript
from rover_sim.frames import Frame
from rover_sim.mission_storage import MissionConventions
from rover_sim.modes import Mode as Mode
from rover_sim.modes import ModeNumbers
from rover_sim.parameters import INT8, INT16, INT32, REAL32, Parameter
from rover_sim.realism import (
    SHORT,
    BootTimes,
    EstimatorError,
    Gps,
    LinkTiming,
    PushingError,
    Realism,
)
from rover_sim.streams import StreamTable

ASSETS = Path(__file__).parent / "assets"
TYPES = {"int8": INT8, "int16": INT16, "int32": INT32}


@dataclass(frozen=True, slots=True)
class OfferedMode:
    """One mode as a client displays it."""

    mode: Mode
    standard: int  # MAV_STANDARD_MODE
    name: str  # empty for a standard mode: the client names it
    properties: int  # MAV_MODE_PROPERTY


@dataclass(frozen=True, slots=True)
class HomeRule:
    """Conditions in which one make moves home, as on the real autopilots.

    From the sources of ArduPilot Rover 4.6 (commands.cpp, update_home) and PX4 1.17
    (HomePosition.cpp): while disarmed, home follows the rover. DO_SET_HOME fixes it: on ArduPilot
    in either form, until a restart; on PX4 only with a place, not with "here". Not imitated: PX4
    forgets such a place when it corrects home's altitude, by more than 1 m and within 120 s of an
    arming.
    """

    where_armed: bool  # sets home at each arming
    least_move: float  # m; while disarmed, home follows a rover that is at least this far away
    here_is_kept: bool  # DO_SET_HOME with "here" also fixes home
    nowhere_is_here: bool  # DO_SET_HOME to 0/0 is the rover's position, not refused
    is_told: bool  # HOME_POSITION is sent when home moves; else only as it streams


@dataclass(frozen=True, slots=True)
class FrameTraits:
    """What depends on the frame."""

    parameters: tuple[Parameter, ...]
    stick_speed: float | None = None  # m/s at full throttle, in GUIDED; None: ignored
    pushing: PushingError | None = None  # additional estimation error


@dataclass(frozen=True, slots=True)
class Persona:
    """One make and version of autopilot."""

    name: str
    autopilot: MavAutopilot
    modes: ModeNumbers
    mode_flags: Mapping[Mode, int]  # HEARTBEAT.base_mode, without SAFETY_ARMED
    offered_modes: tuple[OfferedMode, ...]  # AVAILABLE_MODES; empty: it sends no such list
    capabilities: int  # AUTOPILOT_VERSION.capabilities
    flight_sw_version: int  # AUTOPILOT_VERSION: major, minor, patch, type, a byte each
    firmware_hash: str  # AUTOPILOT_VERSION.flight_custom_version, 8 characters
    heeds_component: bool  # ignores messages to another component of its system
    also_healthy: int  # SYS_STATUS: sensors reported healthy although not present
    enables_prearm: bool  # SYS_STATUS: the pre-arm check is present and enabled, not only healthy
    landed_states: tuple[MavLandedState, MavLandedState]  # EXTENDED_SYS_STATE: armed, disarmed
    no_mission_total: int  # MISSION_CURRENT.total if no mission is stored
    lacks: frozenset[int]  # ids of messages that this make cannot send
    accepted_in_silence: frozenset[int]  # ids of REQUEST_MESSAGE: accepted, but not sent
    streams: StreamTable
    stack: str  # whose flight and drive train
    commands: Mapping[int, str]  # by MAV_CMD: a method of Commands, a MAV_RESULT, "": no answer
    results: Mapping[str, MavResult]  # of what is refused
    set_mode_acked_as: int  # the command id in the COMMAND_ACK of the message SET_MODE
    force_arm: tuple[float, ...]  # param2 of COMPONENT_ARM_DISARM that skips the checks
    texts: Mapping[str, str]  # also the names of modes; empty: nothing is said
    position_lost: Mode  # entered if the position is lost in a mode that needs it
    drives_square: bool  # in AUTO without a mission
    missions: MissionConventions
    #: integer parameters are sent as their bytes in a float, not as numbers; the list is sorted,
    #: and has a hash
    bytewise: bool
    system_id_parameter: str  # name of the parameter with the system id
    speed_parameter: str  # name of the parameter with the speed limit, m/s
    honours_yaw_rate: bool  # of a setpoint; only PX4's rules use it, ArduPilot always honours it
    boot: BootTimes  # in real time
    timing: LinkTiming
    boot_script: BootScript
    home: HomeRule
    answers_first_peer: bool  # on a socket, and no other peer until it restarts
    estimators: Mapping[Gps, EstimatorError]
    realism: Realism  # the default realism
    frames: Mapping[Frame, FrameTraits]
    frame: Frame  # how it steers
    parameters: tuple[Parameter, ...]
    #: COM_OBL_RC_ACT and NAV_RCL_ACT: a mode, or disarm. A mode of the sticks needs them; without,
    #: the second table applies
    offboard_loss: Mapping[int, str] = field(default_factory=dict)
    stick_loss: Mapping[int, str] = field(default_factory=dict)
    runtime_parameter: str | None = None  # counts its seconds of runtime, and is sent unasked

    def on(self, frame: Frame) -> "Persona":
        """Return the same make on another frame; its parameters identify the frame."""
        own = self.frames[frame if frame is Frame.ACKERMANN else Frame.SKID]
        realism = replace(
            self.realism,
            estimator=self.estimators[Gps.FINE],
            pushing=own.pushing,
            stick_speed=own.stick_speed,
        )
        return replace(self, frame=frame, parameters=own.parameters, realism=realism)


def _table(name: str) -> dict[str, Any]:
    return tomllib.loads((ASSETS / f"{name}.toml").read_text(encoding="utf-8"))


def _persona(table: dict[str, Any]) -> Persona:
    frames = {}
    for frame, traits in table["frames"].items():
        values = table["parameters"] | traits["parameters"]
        names = sorted(values) if table["bytewise"] else values
        parameters = [_parameter(name, values[name]) for name in names]
        frames[frame] = {**traits, "parameters": parameters}
    boot = _value(BootTimes, table["boot"])
    realism = {"boot": boot.scaled(SHORT), "timing": table["timing"]}
    more = {"realism": realism, "frames": frames, "parameters": ()}
    given: Persona = _value(Persona, {**table, **more})
    return given.on(given.frame)


def _parameter(name: str, value: Any) -> Parameter:
    """Return a parameter: a decimal number, a whole one, or a table of its type and value."""
    if isinstance(value, dict):
        ((kind, value),) = value.items()
        return Parameter(name, value, TYPES[kind])
    return Parameter(name, value, REAL32 if isinstance(value, float) else INT32)


def _value(kind: Any, given: Any) -> Any:
    """Return what a table says as a ``kind``, part by part.

    A dataclass is a table of its fields, or a list of their values; an enum's member and a
    message's id are named.
    """
    origin, inner = get_origin(kind), get_args(kind)
    if origin is UnionType:  # or None, which a table leaves out
        return _value(inner[0], given)
    if origin is Mapping:
        return {_value(inner[0], key): _value(inner[1], each) for key, each in given.items()}
    if origin in (tuple, frozenset):
        kinds = inner if len(inner) > 1 and inner[1] is not Ellipsis else repeat(inner[0])
        return origin(map(_value, kinds, given))
    if is_dataclass(kind) and isinstance(given, dict | list):
        make = cast(Any, kind)
        hints = _hints(make)
        named = given.items() if isinstance(given, dict) else zip(hints, given, strict=False)
        return make(**{name: _value(hints[name], each) for name, each in named})
    if isinstance(given, str) and isinstance(kind, type) and issubclass(kind, Enum):
        return kind[given.upper()]
    if isinstance(given, str) and kind is int:
        if given in MavCmd.__members__:
            return MavCmd[given]
        return int(given) if given.isdecimal() else getattr(messages, given).id
    return given


_hints = cache(get_type_hints)

_PX4 = _table("px4")
ARDUPILOT, PX4, GENERIC = map(_persona, (_table("ardupilot"), _PX4, _PX4 | _table("generic")))
PERSONAS: Mapping[str, Persona] = {each.name: each for each in (ARDUPILOT, PX4, GENERIC)}
