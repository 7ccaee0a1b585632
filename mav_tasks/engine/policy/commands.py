"""A row of the policy table, and the policy of commands: MAV_CMD of MAVLink's sets, and ours.

A row has the kind of a message or command, and the role that may send it. It says what a rover
does that is sent the command, not what the command means in a plan.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum

from mav_tasks.engine.clients.rights import OBSERVER, OPERATOR, SAFETY, SUBMITTER


class Kind(Enum):
    """What a client's message may do to a rover; the value is its text in the printed table."""

    HALT = "stops the vehicle or its task"
    GO = "resumes, starts, arms, or changes the mode"
    MOTION = "moves the vehicle, or disturbs its motion"
    #: apart from MOTION, because by manual control a person takes a rover over from a task
    STICKS = "manual control; during a task a takeover"
    #: no drive command, but not known to be harmless: a servo, a camera, a position estimate
    ACTION = "has another immediate effect, which may lead to motion"
    WISH = "is stored or set; moves nothing by itself"
    #: apart from QUESTION, because it has no answer, and a dropped one is not reported
    TELL = "informs; needs no answer"
    QUESTION = "requests information"


MOVES_NOTHING = frozenset({Kind.HALT, Kind.WISH, Kind.TELL, Kind.QUESTION})


@dataclass(frozen=True, slots=True)
class Row:
    """The policy for one message or command from a client."""

    name: str
    kind: Kind
    #: the lowest role that may send it
    role: str
    #: what it is about, for the printed table
    about: str = ""
    #: only from a client granted control since the last halt (``motion_gate.why_not_moved``)
    needs_grant: bool = False
    #: the server handles it, at its own address and, as far as it claims that, at the rover's
    is_claimed: bool = False
    #: may change more than motion: the rover's limits, its software, its position estimate
    is_bound: bool = False
    #: counts as a request; otherwise its rate is limited only before parsing
    is_counted: bool = True
    #: its row where the server does not handle it: for another component, or not claimed
    elsewhere: "Row | None" = None

    @property
    def passed_on(self) -> "Row":
        """Row that applies when it is forwarded to a rover."""
        return (self.elsewhere or UNKNOWN) if self.is_claimed else self

    @property
    def passes_under_stop(self) -> bool:
        """Whether it is forwarded to a rover while STOP is in force."""
        return self.kind in MOVES_NOTHING

    @property
    def passes_beside_task(self) -> bool:
        """Whether it is forwarded to a rover that a task drives."""
        return self.kind is not Kind.MOTION


#: a number that no table lists counts as the most dangerous kind
UNKNOWN = Row("", Kind.MOTION, OPERATOR, "not listed")


#: numbers reserved for tasks
TASK_COMMANDS = range(54000, 54050)

ACTS = Row("", Kind.ACTION, OPERATOR, "servos, relays, cameras, gimbals, home")
ASKS = Row("", Kind.QUESTION, OBSERVER, "requests for information")
GOES = Row("", Kind.GO, OPERATOR, "arms, changes the mode, starts the vehicle's own mission")
MOVES = Row(
    "", Kind.MOTION, OPERATOR, "drives to a place, at a speed, on a course", needs_grant=True
)
#: turns wheels, or stops the autopilot: never while it is driven, and only with role safety
SERVICES = Row(
    "",
    Kind.MOTION,
    SAFETY,
    "motor tests, calibration, firmware, restart",
    is_bound=True,
)
BOUNDS = Row(
    "", Kind.ACTION, SAFETY, "fence, parameters, storage, position estimates", is_bound=True
)
SUBMITS = Row("", Kind.WISH, SUBMITTER, "creates a task", is_claimed=True)


def handled(name: str, kind: Kind, role: str, about: str, elsewhere: Row | None = None) -> Row:
    """Return the row of what the server handles; ``elsewhere`` applies where it does not."""
    return Row(name, kind, role, about, is_claimed=True, elsewhere=elsewhere)


def named(row: Row, names: str) -> dict[int, Row]:
    """Return equal rows for several names, by number; ``names`` is like "1 THIS, 2 THAT"."""
    pairs = (each.split() for each in names.split(","))
    return {int(number): replace(row, name=name) for number, name in pairs}


#: rows of commands by content; the row of their number is that of the most dangerous content
DISARM = Row("COMPONENT_ARM_DISARM with param1 = 0", Kind.HALT, OBSERVER, "disarms")
PAUSE = handled("DO_PAUSE_CONTINUE with param1 = 0", Kind.HALT, OBSERVER, "pauses", GOES)
PAUSE_HERE = replace(PAUSE, name="DO_REPOSITION without a place", elsewhere=MOVES)
HOLD = handled("DO_SET_MODE, SET_MODE: HOLD", Kind.HALT, OBSERVER, "sets HOLD")
START = handled(
    "DO_SET_MODE, SET_MODE: return, or the mission",
    Kind.GO,
    SUBMITTER,
    "starts a return or the mission, which the server drives",
)
#: rows that have no number of their own
BY_WORDS = (DISARM, PAUSE, PAUSE_HERE, HOLD, START)

OURS = {
    **named(SUBMITS, "54000 TASK_MOVE, 54001 TASK_ROTATE, 54002 TASK_DRIVE"),
    **named(replace(SUBMITS, about="options of a plan, only as its item"), "54014 TASK_OPTIONS"),
    **named(replace(SUBMITS, about="whom the next item of a plan is for"), "54015 TASK_ACT"),
    **named(replace(SUBMITS, about="changes one's own task"), "54012 TASK_MODIFY"),
    54003: handled("TASK_STOP", Kind.HALT, OBSERVER, "STOP, at any component"),
    54010: handled("TASK_CANCEL", Kind.HALT, SUBMITTER, "cancels one's own task"),
    54011: handled("TASK_CLEAR", Kind.HALT, OPERATOR, "cancels everybody's tasks"),
    54013: handled("TASK_RELEASE", Kind.GO, SUBMITTER, "releases one's own task"),
}

#: standard commands that the server handles
CLAIMED = {
    **named(
        replace(SUBMITS, elsewhere=MOVES),
        """16 NAV_WAYPOINT, 19 NAV_LOITER_TIME, 115 CONDITION_YAW, 192 DO_REPOSITION,
        213 NAV_SET_YAW_SPEED""",
    ),
    **named(replace(SUBMITS, elsewhere=GOES), "20 NAV_RETURN_TO_LAUNCH"),
    **named(replace(SUBMITS, elsewhere=ACTS), "93 NAV_DELAY"),
    21: handled("NAV_LAND", Kind.WISH, OBSERVER, "disarms once no task is left", GOES),
    22: handled("NAV_TAKEOFF", Kind.WISH, OBSERVER, "take-off: accepted without effect", MOVES),
    178: handled("DO_CHANGE_SPEED", Kind.WISH, OPERATOR, "sets the speed of tasks", MOVES),
    193: handled("DO_PAUSE_CONTINUE", Kind.GO, OPERATOR, "resumes", GOES),
    176: replace(GOES, name="DO_SET_MODE", about="any other mode"),
    224: handled("DO_SET_MISSION_CURRENT", Kind.GO, SUBMITTER, "starts one's own plan", GOES),
    300: handled("MISSION_START", Kind.GO, SUBMITTER, "starts one's own plan", GOES),
    511: handled(
        "SET_MESSAGE_INTERVAL", Kind.QUESTION, OBSERVER, "message rates of one client", ACTS
    ),
    **named(
        replace(ASKS, is_claimed=True, elsewhere=ASKS),
        "510 GET_MESSAGE_INTERVAL, 512 REQUEST_MESSAGE",
    ),
}

#: commands that are forwarded to the rover
PASSED_ON = {
    **named(
        ASKS,
        """410 GET_HOME_POSITION, 519 REQUEST_PROTOCOL_VERSION, 520 REQUEST_AUTOPILOT_CAPABILITIES,
        521 REQUEST_CAMERA_INFORMATION, 522 REQUEST_CAMERA_SETTINGS,
        525 REQUEST_STORAGE_INFORMATION, 527 REQUEST_CAMERA_CAPTURE_STATUS,
        528 REQUEST_FLIGHT_INFORMATION""",
    ),
    **named(
        replace(ASKS, role=OPERATOR, about="requests that are expensive to answer"),
        """401 RUN_PREARM_CHECKS, 2002 REQUEST_CAMERA_IMAGE_CAPTURE,
        2504 REQUEST_VIDEO_STREAM_INFORMATION, 2505 REQUEST_VIDEO_STREAM_STATUS,
        5200 UAVCAN_GET_NODE_INFO, 42428 DO_SEND_BANNER, 42502 GIMBAL_AXIS_CALIBRATION_STATUS""",
    ),
    **named(
        GOES,
        """92 NAV_GUIDED_ENABLE, 177 DO_JUMP, 185 DO_FLIGHTTERMINATION, 188 DO_RETURN_PATH_START,
        189 DO_LAND_START, 190 DO_RALLY_LAND, 191 DO_GO_AROUND, 221 DO_GUIDED_MASTER,
        223 DO_ENGINE_CONTROL, 262 DO_SET_STANDARD_MODE, 400 COMPONENT_ARM_DISARM,
        601 DO_JUMP_TAG, 3001 ARM_AUTHORIZATION_REQUEST, 42001 SOLO_BTN_FLY_CLICK,
        42002 SOLO_BTN_FLY_HOLD, 42003 SOLO_BTN_PAUSE_CLICK""",
    ),
    **named(
        replace(GOES, role=SAFETY, is_bound=True, about="auxiliary functions, safety switch"),
        "218 DO_AUX_FUNCTION, 5300 DO_SET_SAFETY_SWITCH_STATE",
    ),
    **named(
        MOVES,
        """17 NAV_LOITER_UNLIM, 18 NAV_LOITER_TURNS, 23 NAV_LAND_LOCAL, 24 NAV_TAKEOFF_LOCAL,
        25 NAV_FOLLOW, 30 NAV_CONTINUE_AND_CHANGE_ALT, 31 NAV_LOITER_TO_ALT, 32 DO_FOLLOW,
        33 DO_FOLLOW_REPOSITION, 34 DO_ORBIT, 35 DO_FIGURE_EIGHT, 36 NAV_ARC_WAYPOINT,
        81 NAV_PATHPLANNING, 82 NAV_SPLINE_WAYPOINT, 83 NAV_ALTITUDE_WAIT, 84 NAV_VTOL_TAKEOFF,
        85 NAV_VTOL_LAND, 94 NAV_PAYLOAD_PLACE, 113 CONDITION_CHANGE_ALT, 186 DO_CHANGE_ALTITUDE,
        194 DO_SET_REVERSE, 252 OVERRIDE_GOTO, 3000 DO_VTOL_TRANSITION,
        4000 SET_GUIDED_SUBMODE_STANDARD, 4001 SET_GUIDED_SUBMODE_CIRCLE,
        30001 PAYLOAD_PREPARE_DEPLOY, 42702 NAV_SCRIPT_TIME, 42703 NAV_ATTITUDE_TIME,
        43000 GUIDED_CHANGE_SPEED, 43001 GUIDED_CHANGE_ALTITUDE, 43002 GUIDED_CHANGE_HEADING""",
    ),
    **named(
        replace(UNKNOWN, about="meaning defined by an on-board script or a user"),
        """217 DO_SEND_SCRIPT_MESSAGE, 31000 WAYPOINT_USER_1, 31001 WAYPOINT_USER_2,
        31002 WAYPOINT_USER_3, 31003 WAYPOINT_USER_4, 31004 WAYPOINT_USER_5,
        31005 SPATIAL_USER_1, 31006 SPATIAL_USER_2, 31007 SPATIAL_USER_3, 31008 SPATIAL_USER_4,
        31009 SPATIAL_USER_5, 31010 USER_1, 31011 USER_2, 31012 USER_3, 31013 USER_4,
        31014 USER_5""",
    ),
    **named(
        SERVICES,
        """209 DO_MOTOR_TEST, 241 PREFLIGHT_CALIBRATION, 242 PREFLIGHT_SET_SENSOR_OFFSETS,
        243 PREFLIGHT_UAVCAN, 246 PREFLIGHT_REBOOT_SHUTDOWN, 310 ACTUATOR_TEST,
        311 CONFIGURE_ACTUATOR, 500 START_RX_PAIR, 610 DO_SET_SYS_CMP_ID,
        42000 POWER_OFF_INITIATED, 42004 FIXED_MAG_CAL, 42005 FIXED_MAG_CAL_FIELD,
        42006 FIXED_MAG_CAL_YAW, 42424 DO_START_MAG_CAL, 42425 DO_ACCEPT_MAG_CAL,
        42426 DO_CANCEL_MAG_CAL, 42427 SET_FACTORY_TEST_MODE, 42429 ACCELCAL_VEHICLE_POS,
        42650 FLASH_BOOTLOADER, 42700 DEBUG_TRAP, 42701 SCRIPTING""",
    ),
    **named(
        BOUNDS,
        """180 DO_SET_PARAMETER, 207 DO_FENCE_ENABLE, 212 DO_AUTOTUNE_ENABLE, 222 DO_GUIDED_LIMITS,
        245 PREFLIGHT_STORAGE, 420 INJECT_FAILURE, 526 STORAGE_FORMAT, 611 DO_SET_GLOBAL_ORIGIN,
        2600 CONTROL_HIGH_LATENCY, 5000 NAV_FENCE_RETURN_POINT,
        5001 NAV_FENCE_POLYGON_VERTEX_INCLUSION, 5002 NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
        5003 NAV_FENCE_CIRCLE_INCLUSION, 5004 NAV_FENCE_CIRCLE_EXCLUSION,
        5005 NAV_FENCE_HOME_CIRCLE_INCLUSION, 5100 NAV_RALLY_POINT, 32000 CAN_FORWARD,
        42007 SET_EKF_SOURCE_SET, 42505 GIMBAL_FULL_RESET, 42651 BATTERY_RESET,
        43003 EXTERNAL_POSITION_ESTIMATE, 43004 EXTERNAL_WIND_ESTIMATE, 43005 SET_HAGL""",
    ),
    **named(
        ACTS,
        """80 NAV_ROI, 95 NAV_LAST, 112 CONDITION_DELAY, 114 CONDITION_DISTANCE, 159 CONDITION_LAST,
        179 DO_SET_HOME, 181 DO_SET_RELAY, 182 DO_REPEAT_RELAY, 183 DO_SET_SERVO,
        184 DO_REPEAT_SERVO, 187 DO_SET_ACTUATOR, 195 DO_SET_ROI_LOCATION,
        196 DO_SET_ROI_WPNEXT_OFFSET, 197 DO_SET_ROI_NONE, 198 DO_SET_ROI_SYSID,
        200 DO_CONTROL_VIDEO, 201 DO_SET_ROI, 202 DO_DIGICAM_CONFIGURE, 203 DO_DIGICAM_CONTROL,
        204 DO_MOUNT_CONFIGURE, 205 DO_MOUNT_CONTROL, 206 DO_SET_CAM_TRIGG_DIST,
        208 DO_PARACHUTE, 210 DO_INVERTED_FLIGHT, 211 DO_GRIPPER, 214 DO_SET_CAM_TRIGG_INTERVAL,
        215 DO_SET_RESUME_REPEAT_DIST, 216 DO_SPRAYER, 220 DO_MOUNT_CONTROL_QUAT, 240 DO_LAST,
        260 OBLIQUE_SURVEY, 405 ILLUMINATOR_ON_OFF, 406 DO_ILLUMINATOR_CONFIGURE,
        529 RESET_CAMERA_SETTINGS, 530 SET_CAMERA_MODE, 531 SET_CAMERA_ZOOM,
        532 SET_CAMERA_FOCUS, 533 SET_STORAGE_USAGE, 534 SET_CAMERA_SOURCE, 600 JUMP_TAG,
        1000 DO_GIMBAL_MANAGER_PITCHYAW, 1001 DO_GIMBAL_MANAGER_CONFIGURE,
        2000 IMAGE_START_CAPTURE, 2001 IMAGE_STOP_CAPTURE, 2003 DO_TRIGGER_CONTROL,
        2004 CAMERA_TRACK_POINT, 2005 CAMERA_TRACK_RECTANGLE, 2010 CAMERA_STOP_TRACKING,
        2020 CAMERA_START_MTI, 2021 CAMERA_STOP_MTI, 2500 VIDEO_START_CAPTURE,
        2501 VIDEO_STOP_CAPTURE, 2502 VIDEO_START_STREAMING, 2503 VIDEO_STOP_STREAMING,
        2510 LOGGING_START, 2511 LOGGING_STOP, 2520 AIRFRAME_CONFIGURATION, 2800 PANORAMA_CREATE,
        4501 CONDITION_GATE, 10001 DO_ADSB_OUT_IDENT, 10151 LOWEHEISER_SET_STATE,
        30002 PAYLOAD_CONTROL_DEPLOY, 40001 RESET_MPPT, 40002 PAYLOAD_CONTROL,
        42501 GIMBAL_RESET, 42503 GIMBAL_REQUEST_AXIS_CALIBRATION, 42600 DO_WINCH""",
    ),
}

COMMANDS: Mapping[int, Row] = {**PASSED_ON, **CLAIMED, **OURS}
