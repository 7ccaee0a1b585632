"""The MAVLink enum families in use, as IntEnums; tested equal to the generated constants."""

from enum import IntEnum, IntFlag


class MavResult(IntEnum):
    """MAV_RESULT. 7 and above are never sent: they crash MAVSDK processes."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4
    IN_PROGRESS = 5
    CANCELLED = 6


class MavCmd(IntEnum):
    """MAV_CMD, as far as the server, its files or the simulated rover tell one from another."""

    NAV_WAYPOINT = 16
    NAV_LOITER_UNLIM = 17
    NAV_LOITER_TIME = 19
    NAV_RETURN_TO_LAUNCH = 20
    NAV_LAND = 21
    NAV_TAKEOFF = 22
    NAV_DELAY = 93
    CONDITION_DELAY = 112
    CONDITION_DISTANCE = 114
    CONDITION_YAW = 115
    DO_SET_MODE = 176
    DO_SET_STANDARD_MODE = 262
    DO_JUMP = 177
    DO_CHANGE_SPEED = 178
    DO_SET_HOME = 179
    DO_REPOSITION = 192
    DO_PAUSE_CONTINUE = 193
    DO_MOTOR_TEST = 209
    DO_SET_MISSION_CURRENT = 224
    NAV_SET_YAW_SPEED = 213
    PREFLIGHT_REBOOT_SHUTDOWN = 246
    MISSION_START = 300
    COMPONENT_ARM_DISARM = 400
    RUN_PREARM_CHECKS = 401
    GET_HOME_POSITION = 410
    GET_MESSAGE_INTERVAL = 510
    SET_MESSAGE_INTERVAL = 511
    REQUEST_MESSAGE = 512
    REQUEST_PROTOCOL_VERSION = 519
    REQUEST_AUTOPILOT_CAPABILITIES = 520
    NAV_FENCE_RETURN_POINT = 5000
    NAV_FENCE_POLYGON_VERTEX_INCLUSION = 5001
    NAV_FENCE_POLYGON_VERTEX_EXCLUSION = 5002
    NAV_FENCE_CIRCLE_INCLUSION = 5003
    NAV_FENCE_CIRCLE_EXCLUSION = 5004
    NAV_RALLY_POINT = 5100
    TASK_MOVE = 54000
    TASK_ROTATE = 54001
    TASK_DRIVE = 54002
    TASK_STOP = 54003
    TASK_CANCEL = 54010
    TASK_CLEAR = 54011
    TASK_MODIFY = 54012
    TASK_RELEASE = 54013
    TASK_OPTIONS = 54014
    TASK_ACT = 54015


class MavFrame(IntEnum):
    """MAV_FRAME."""

    GLOBAL = 0
    LOCAL_NED = 1
    MISSION = 2
    GLOBAL_RELATIVE_ALT = 3
    LOCAL_ENU = 4
    GLOBAL_INT = 5
    GLOBAL_RELATIVE_ALT_INT = 6
    LOCAL_OFFSET_NED = 7
    BODY_NED = 8
    BODY_OFFSET_NED = 9
    GLOBAL_TERRAIN_ALT = 10
    GLOBAL_TERRAIN_ALT_INT = 11
    BODY_FRD = 12
    LOCAL_FRD = 20


class MavType(IntEnum):
    """MAV_TYPE."""

    GENERIC = 0
    GCS = 6
    GROUND_ROVER = 10
    SURFACE_BOAT = 11
    ONBOARD_CONTROLLER = 18


class MavAutopilot(IntEnum):
    """MAV_AUTOPILOT."""

    GENERIC = 0
    ARDUPILOTMEGA = 3
    INVALID = 8
    PX4 = 12


class MavState(IntEnum):
    """MAV_STATE."""

    UNINIT = 0
    BOOT = 1
    CALIBRATING = 2
    STANDBY = 3
    ACTIVE = 4
    CRITICAL = 5
    EMERGENCY = 6
    POWEROFF = 7


class MavModeFlag(IntFlag):
    """MAV_MODE_FLAG."""

    CUSTOM_MODE_ENABLED = 1
    AUTO_ENABLED = 4
    GUIDED_ENABLED = 8
    STABILIZE_ENABLED = 16
    MANUAL_INPUT_ENABLED = 64
    SAFETY_ARMED = 128


class MavSeverity(IntEnum):
    """MAV_SEVERITY."""

    EMERGENCY = 0
    ALERT = 1
    CRITICAL = 2
    ERROR = 3
    WARNING = 4
    NOTICE = 5
    INFO = 6
    DEBUG = 7


class MavMissionResult(IntEnum):
    """MAV_MISSION_RESULT."""

    ACCEPTED = 0
    ERROR = 1
    UNSUPPORTED_FRAME = 2
    UNSUPPORTED = 3
    NO_SPACE = 4
    INVALID = 5
    INVALID_PARAM1 = 6
    INVALID_PARAM2 = 7
    INVALID_PARAM3 = 8
    INVALID_PARAM4 = 9
    INVALID_PARAM5_X = 10
    INVALID_PARAM6_Y = 11
    INVALID_PARAM7 = 12
    INVALID_SEQUENCE = 13
    DENIED = 14
    OPERATION_CANCELLED = 15


class MavMissionType(IntEnum):
    """MAV_MISSION_TYPE."""

    MISSION = 0
    FENCE = 1
    RALLY = 2
    ALL = 255


class MavParamType(IntEnum):
    """How a parameter's value is written."""

    REAL32 = 9


class MavParamError(IntEnum):
    """Why a parameter was not told or set."""

    DOES_NOT_EXIST = 1
    VALUE_OUT_OF_RANGE = 2
    PERMISSION_DENIED = 3


class MavLandedState(IntEnum):
    """MAV_LANDED_STATE."""

    UNDEFINED = 0
    ON_GROUND = 1
    IN_AIR = 2


class MavComponent(IntEnum):
    """MAV_COMPONENT, as far as used."""

    ALL = 0
    AUTOPILOT1 = 1
    MISSIONPLANNER = 190
    ONBOARD_COMPUTER = 191
    ONBOARD_COMPUTER4 = 194


class PositionTargetTypemask(IntFlag):
    """POSITION_TARGET_TYPEMASK: a set bit means the field is ignored."""

    X_IGNORE = 1
    Y_IGNORE = 2
    Z_IGNORE = 4
    VX_IGNORE = 8
    VY_IGNORE = 16
    VZ_IGNORE = 32
    AX_IGNORE = 64
    AY_IGNORE = 128
    AZ_IGNORE = 256
    FORCE_SET = 512
    YAW_IGNORE = 1024
    YAW_RATE_IGNORE = 2048


class TaskProperty(IntEnum):
    """TASK_PROPERTY of our dialect: what TASK_MODIFY changes."""

    PRIORITY = 1
    START_DELAY = 2
    DEADLINE = 3
    RUN_AFTER = 4
    PREEMPTIBLE = 5
    PREEMPTIVE = 6
    START_UTC = 7
    LABEL = 8
    EVERY = 9
    REPEAT = 10
    RUN_BEFORE = 11
