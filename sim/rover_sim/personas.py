"""The differences between makes of autopilot: numbers, names and strategies.

``ardupilot`` is Rover 4.6.3 as observed on the wire; ``px4`` is a rover on PX4 1.17, from its
sources and as observed; ``generic`` speaks as PX4 does. A persona names objects (flight rules,
commands, conventions) for the behaviour that differs; no code tests its name.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.enums import MavAutopilot, MavLandedState, MavModeFlag
from rover_sim.ardupilot_commands import ardupilot_commands
from rover_sim.ardupilot_parameters import Cast, ardupilot_parameters
from rover_sim.ardupilot_rules import ArduPilotRules
from rover_sim.available_modes import PX4_OFFERED, OfferedMode
from rover_sim.boot import ARDUPILOT_SCRIPT, PX4_SCRIPT, BootScript
from rover_sim.commands import CommandParts, CommandTable
from rover_sim.drive_train import DriveTrain, ardupilot_drive, px4_drive
from rover_sim.flight_rules import FlightParts, FlightRules
from rover_sim.frames import Frame
from rover_sim.home import ARDUPILOT_HOME, PX4_HOME, HomeRule
from rover_sim.mission_conventions import ARDUPILOT_MISSIONS, PX4_MISSIONS, MissionConventions
from rover_sim.modes import Mode as Mode
from rover_sim.modes import ModeNumbers
from rover_sim.parameters import INT32, Parameter, ParameterProtocol, Parameters
from rover_sim.px4_commands import px4_commands
from rover_sim.px4_parameters import Bytewise, px4_parameters
from rover_sim.px4_rules import Px4Rules
from rover_sim.realism import (
    ARDUPILOT_BOOT,
    ARDUPILOT_ESTIMATOR,
    ARDUPILOT_REALISM,
    PUSHING,
    PX4_BOOT,
    PX4_ESTIMATOR,
    PX4_REALISM,
    STICK_SPEEDS,
    BootTimes,
    EstimatorError,
    Gps,
    PushingError,
    Realism,
)
from rover_sim.streams import ARDUPILOT_STREAMS, PX4_STREAMS, StreamTable

GEOFENCE = 0x100000  # MAV_SYS_STATUS_GEOFENCE: ArduPilot reports it healthy unless it is breached


@dataclass(frozen=True, slots=True)
class Persona:
    """One make and version of autopilot."""

    name: str
    autopilot: MavAutopilot
    modes: ModeNumbers
    offered_modes: tuple[OfferedMode, ...]  # AVAILABLE_MODES; empty: it sends no such list
    mode_flags: Mapping[Mode, int]  # HEARTBEAT.base_mode, without SAFETY_ARMED
    capabilities: int  # AUTOPILOT_VERSION.capabilities
    flight_sw_version: int  # AUTOPILOT_VERSION: major, minor, patch, type, a byte each
    firmware_hash: bytes  # AUTOPILOT_VERSION.flight_custom_version, 8 bytes
    heeds_component: bool  # ignores messages to another component of its system
    also_healthy: int  # SYS_STATUS: sensors reported healthy although not present
    landed_state_armed: MavLandedState  # EXTENDED_SYS_STATE while armed
    no_mission_total: int  # MISSION_CURRENT.total if no mission is stored
    lacks: frozenset[int]  # ids of messages that this make cannot send
    streams: StreamTable
    rules: Callable[[FlightParts], FlightRules]
    commands: Callable[[CommandParts], CommandTable]
    missions: MissionConventions
    parameter_protocol: ParameterProtocol
    parameters: tuple[Parameter, ...]
    parameters_of: Callable[[Frame], tuple[Parameter, ...]]
    system_id_parameter: str  # name of the parameter with the system id
    speed_parameter: str  # name of the parameter with the speed limit, m/s
    honours_yaw_rate: bool  # of a setpoint; only PX4's rules use it, ArduPilot always honours it
    realism: Realism  # the default realism
    estimators: Mapping[Gps, EstimatorError]
    pushing: PushingError | None  # additional estimation error, on an Ackermann rover
    boot: BootTimes  # in real time
    boot_script: BootScript
    home: HomeRule
    tells_no_landed_state: bool  # EXTENDED_SYS_STATE: always undefined
    shows_prearm_in_health_only: bool  # SYS_STATUS
    accepted_in_silence: frozenset[int]  # ids of REQUEST_MESSAGE: accepted, but not sent
    answers_first_peer: bool  # on a socket, and no other peer until it restarts
    runtime_parameter: Parameter | None  # counts its seconds of runtime
    frame: Frame  # how it steers
    drive: Callable[[Frame, Parameters], DriveTrain]

    def on(self, frame: Frame) -> "Persona":
        """Return the same make on another frame; its parameters identify the frame."""
        pushing = self.pushing if frame is Frame.ACKERMANN else None
        realism, own = self.realism, self.realism.estimator
        adds_speed = realism.stick_speed is not None
        return replace(
            self,
            frame=frame,
            parameters=self.parameters_of(frame),
            estimators={gps: replace(e, pushing=pushing) for gps, e in self.estimators.items()},
            realism=replace(
                realism,
                estimator=own and replace(own, pushing=pushing),
                stick_speed=STICK_SPEEDS[frame] if adds_speed else None,
            ),
        )


ARDUPILOT = Persona(
    name="ardupilot",
    autopilot=MavAutopilot.ARDUPILOTMEGA,
    modes=ModeNumbers(
        {
            Mode.MANUAL: 0,
            Mode.HOLD: 4,
            Mode.AUTO: 10,
            Mode.RTL: 11,
            Mode.GUIDED: 15,
            Mode.INITIALISING: 16,
        },
        first=Mode.INITIALISING,
    ),
    offered_modes=(),
    mode_flags={
        Mode.INITIALISING: MavModeFlag.CUSTOM_MODE_ENABLED,
        Mode.MANUAL: MavModeFlag.CUSTOM_MODE_ENABLED | MavModeFlag.MANUAL_INPUT_ENABLED,
        Mode.HOLD: MavModeFlag.CUSTOM_MODE_ENABLED,
        Mode.AUTO: MavModeFlag.CUSTOM_MODE_ENABLED | MavModeFlag.GUIDED_ENABLED,
        Mode.RTL: MavModeFlag.CUSTOM_MODE_ENABLED | MavModeFlag.GUIDED_ENABLED,
        Mode.GUIDED: MavModeFlag.CUSTOM_MODE_ENABLED | MavModeFlag.GUIDED_ENABLED,
    },
    capabilities=61935,
    flight_sw_version=4 << 24 | 6 << 16 | 3 << 8 | 255,  # 4.6.3, official
    firmware_hash=b"3fc7011a",
    heeds_component=False,
    also_healthy=GEOFENCE,
    landed_state_armed=MavLandedState.ON_GROUND,
    no_mission_total=0,
    lacks=frozenset(
        {
            messages.ProtocolVersion.id,
            messages.CurrentMode.id,
        }
    ),
    streams=ARDUPILOT_STREAMS,
    rules=ArduPilotRules,
    commands=ardupilot_commands,
    missions=ARDUPILOT_MISSIONS,
    parameter_protocol=Cast(),
    parameters=ardupilot_parameters(Frame.SKID),
    parameters_of=ardupilot_parameters,
    system_id_parameter="SYSID_THISMAV",
    speed_parameter="WP_SPEED",
    honours_yaw_rate=True,
    realism=ARDUPILOT_REALISM,
    estimators=ARDUPILOT_ESTIMATOR,
    pushing=None,
    boot=ARDUPILOT_BOOT,
    boot_script=ARDUPILOT_SCRIPT,
    home=ARDUPILOT_HOME,
    tells_no_landed_state=True,
    shows_prearm_in_health_only=False,
    accepted_in_silence=frozenset({280}),  # GIMBAL_MANAGER_INFORMATION without a gimbal
    answers_first_peer=False,
    runtime_parameter=Parameter("STAT_RUNTIME", 0, INT32),
    frame=Frame.SKID,
    drive=ardupilot_drive,
)

STICKS = MavModeFlag.CUSTOM_MODE_ENABLED | MavModeFlag.MANUAL_INPUT_ENABLED
BY_ITSELF = (
    MavModeFlag.CUSTOM_MODE_ENABLED
    | MavModeFlag.AUTO_ENABLED
    | MavModeFlag.STABILIZE_ENABLED
    | MavModeFlag.GUIDED_ENABLED
)

PX4 = Persona(
    name="px4",
    autopilot=MavAutopilot.PX4,
    modes=ModeNumbers(
        {
            Mode.MANUAL: 1 << 16,
            Mode.POSITION: 3 << 16,
            Mode.HOLD: 4 << 16 | 3 << 24,
            Mode.AUTO: 4 << 16 | 4 << 24,
            Mode.RTL: 4 << 16 | 5 << 24,
            Mode.LAND: 4 << 16 | 6 << 24,
            Mode.GUIDED: 6 << 16,
        },
        first=Mode.HOLD,  # like a SITL without sticks
    ),
    offered_modes=PX4_OFFERED,
    mode_flags={
        Mode.MANUAL: STICKS,
        Mode.POSITION: STICKS | MavModeFlag.STABILIZE_ENABLED | MavModeFlag.GUIDED_ENABLED,
        Mode.HOLD: BY_ITSELF,
        Mode.AUTO: BY_ITSELF,
        Mode.RTL: BY_ITSELF,
        Mode.LAND: BY_ITSELF,
        Mode.GUIDED: BY_ITSELF,
    },
    # MISSION_INT, COMMAND_INT, PARAM_ENCODE_BYTEWISE, FTP, SET_POSITION_TARGET_LOCAL_NED,
    # SET_POSITION_TARGET_GLOBAL_INT, MAVLINK2, MISSION_FENCE, MISSION_RALLY
    capabilities=4 | 8 | 16 | 32 | 128 | 256 | 8192 | 16384 | 32768,
    flight_sw_version=1 << 24 | 17 << 16 | 0 << 8 | 255,  # 1.17.0, official
    firmware_hash=b"99c40407",
    heeds_component=True,
    also_healthy=0,
    landed_state_armed=MavLandedState.IN_AIR,  # PX4's rover land detector: armed means not landed
    no_mission_total=65535,
    lacks=frozenset(),
    streams=PX4_STREAMS,
    rules=Px4Rules,
    commands=px4_commands,
    missions=PX4_MISSIONS,
    parameter_protocol=Bytewise(),
    parameters=px4_parameters(Frame.DIFFERENTIAL),
    parameters_of=px4_parameters,
    system_id_parameter="MAV_SYS_ID",
    speed_parameter="RO_SPEED_LIM",
    honours_yaw_rate=False,
    realism=PX4_REALISM,
    estimators=PX4_ESTIMATOR,
    pushing=PUSHING,
    boot=PX4_BOOT,
    boot_script=PX4_SCRIPT,
    home=PX4_HOME,
    tells_no_landed_state=False,
    shows_prearm_in_health_only=True,
    accepted_in_silence=frozenset(),
    answers_first_peer=True,
    runtime_parameter=None,
    frame=Frame.DIFFERENTIAL,
    drive=px4_drive,
)

#: speaks like PX4, but reports an unknown autopilot
GENERIC = replace(
    PX4,
    name="generic",
    autopilot=MavAutopilot.GENERIC,
    flight_sw_version=1 << 24 | 255,
    firmware_hash=bytes(8),
    answers_first_peer=False,
)

PERSONAS: Mapping[str, Persona] = {each.name: each for each in (ARDUPILOT, PX4, GENERIC)}
