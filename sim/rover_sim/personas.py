"""The differences between makes of autopilot, as data: ``assets/ardupilot.toml`` and ``px4.toml``.

``ardupilot`` is Rover 4.6.3 as observed on the wire; ``px4`` is a rover on PX4 1.17, from its
sources and as observed; ``generic`` speaks as PX4 does. Only flight and drive train are code of
their own; no code tests a persona's name.
"""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, is_dataclass, replace
from enum import Enum
from functools import cache
from itertools import repeat
from pathlib import Path
from types import UnionType
from typing import Any, cast, get_args, get_origin, get_type_hints

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.enums import MavAutopilot, MavLandedState
from rover_sim.ardupilot_commands import ardupilot_commands
from rover_sim.ardupilot_rules import ArduPilotRules
from rover_sim.available_modes import OfferedMode
from rover_sim.boot import BootScript
from rover_sim.commands import CommandParts, CommandTable
from rover_sim.drive_train import DriveTrain, ardupilot_drive, px4_drive
from rover_sim.flight_rules import FlightParts, FlightRules
from rover_sim.frames import Frame
from rover_sim.home import HomeRule
from rover_sim.mission_conventions import MissionConventions
from rover_sim.modes import Mode as Mode
from rover_sim.modes import ModeNumbers
from rover_sim.parameters import INT8, INT16, INT32, REAL32, Parameter, Parameters
from rover_sim.px4_commands import px4_commands
from rover_sim.px4_rules import Px4Rules
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
    rules: Callable[[FlightParts], FlightRules]
    commands: Callable[[CommandParts], CommandTable]
    drive: Callable[[Frame, Parameters], DriveTrain]
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
    runtime_parameter: str | None = None  # counts its seconds of runtime, and is sent unasked

    def on(self, frame: Frame) -> "Persona":
        """Return the same make on another frame; its parameters identify the frame."""
        own = self.frames[frame if frame is Frame.ACKERMANN else Frame.SKID]
        estimators = {
            gps: replace(error, pushing=own.pushing) for gps, error in self.estimators.items()
        }
        return replace(
            self,
            frame=frame,
            parameters=own.parameters,
            estimators=estimators,
            realism=replace(
                self.realism, estimator=estimators[Gps.FINE], stick_speed=own.stick_speed
            ),
        )


def _table(name: str) -> dict[str, Any]:
    return tomllib.loads((ASSETS / f"{name}.toml").read_text(encoding="utf-8"))


def _persona(table: dict[str, Any], **code: Any) -> Persona:
    """Return the persona of a table, with the parts that are code."""
    frames = {}
    for frame, traits in table["frames"].items():
        values = table["parameters"] | traits["parameters"]
        names = sorted(values) if table["bytewise"] else values
        parameters = [_parameter(name, values[name]) for name in names]
        frames[frame] = {**traits, "parameters": parameters}
    boot = _value(BootTimes, table["boot"])
    realism = {"boot": boot.scaled(SHORT), "timing": table["timing"]}
    more = {"realism": realism, "frames": frames, "parameters": ()}
    given: Persona = _value(Persona, {**table, **code, **more})
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
        hints, make = _hints(kind), cast(Any, kind)
        named = given.items() if isinstance(given, dict) else zip(hints, given, strict=False)
        return make(**{name: _value(hints[name], each) for name, each in named})
    if isinstance(given, str) and isinstance(kind, type) and issubclass(kind, Enum):
        return kind[given.upper()]
    if isinstance(given, str) and kind is int:
        return int(given) if given.isdecimal() else getattr(messages, given).id
    return given


_hints = cache(get_type_hints)

ARDUPILOT = _persona(
    _table("ardupilot"), rules=ArduPilotRules, commands=ardupilot_commands, drive=ardupilot_drive
)
PX4_CODE: dict[str, Any] = {"rules": Px4Rules, "commands": px4_commands, "drive": px4_drive}
_PX4_TABLE = _table("px4")
PX4 = _persona(_PX4_TABLE, **PX4_CODE)
GENERIC = _persona(_PX4_TABLE | _table("generic"), **PX4_CODE)
PERSONAS: Mapping[str, Persona] = {each.name: each for each in (ARDUPILOT, PX4, GENERIC)}
