"""The policy of messages from clients, of MAVLink's ``common`` and ``ardupilotmega`` sets.

COMMAND_LONG and COMMAND_INT have no row: the commands in them have, see ``commands``.
"""

from collections.abc import Mapping
from dataclasses import replace

from mav_tasks.engine.clients.rights import OBSERVER, OPERATOR, SAFETY, SUBMITTER
from mav_tasks.engine.policy.commands import ACTS, ASKS, BOUNDS, GOES, MOVES, named
from mav_tasks.engine.policy.row import Kind, Row

SETS = Row("", Kind.WISH, SAFETY, "sets parameters, writes files, erases logs", is_bound=True)
TELLS = Row("", Kind.TELL, OPERATOR, "corrections, acknowledgements, identification")
UPLOADS = Row("", Kind.WISH, SUBMITTER, "uploads a mission", is_claimed=True, elsewhere=ACTS)
#: a packet in a packet, whose content is not checked
CARRIES = Row("", Kind.MOTION, SAFETY, "carries arbitrary data, also firmware", is_bound=True)

#: rows of messages by content; the row of their number is that of the most common content
READ_FILE = replace(
    ASKS,
    name="FILE_TRANSFER_PROTOCOL with an opcode that changes no file",
    about="lists and reads files",
)
GO_TO_ITEM = Row(
    "MISSION_ITEM, MISSION_ITEM_INT with current = 2 or 3",
    Kind.WISH,
    SUBMITTER,
    "creates a task",
    is_claimed=True,
    elsewhere=MOVES,
)
BOUNDING_PLAN = Row(
    "uploads and MISSION_CLEAR_ALL with a mission_type other than 0",
    Kind.WISH,
    SAFETY,
    "fence and rally points",
    is_claimed=True,
    is_bound=True,
    elsewhere=BOUNDS,
)
#: rows that have no number of their own
BY_WORDS = (READ_FILE, GO_TO_ITEM, BOUNDING_PLAN)

MESSAGES: Mapping[int, Row] = {
    **named(
        replace(TELLS, about="presence and time", is_counted=False),
        "0 HEARTBEAT, 2 SYSTEM_TIME",
    ),
    **named(
        TELLS,
        """77 COMMAND_ACK, 109 RADIO_STATUS, 134 TERRAIN_DATA, 185 REMOTE_LOG_BLOCK_STATUS,
        233 GPS_RTCM_DATA, 253 STATUSTEXT, 268 LOGGING_ACK, 12900 OPEN_DRONE_ID_BASIC_ID,
        12901 OPEN_DRONE_ID_LOCATION, 12902 OPEN_DRONE_ID_AUTHENTICATION,
        12903 OPEN_DRONE_ID_SELF_ID, 12904 OPEN_DRONE_ID_SYSTEM, 12905 OPEN_DRONE_ID_OPERATOR_ID,
        12915 OPEN_DRONE_ID_MESSAGE_PACK, 12919 OPEN_DRONE_ID_SYSTEM_UPDATE""",
    ),
    **named(replace(ASKS, is_counted=False), "4 PING, 111 TIMESYNC"),
    **named(ASKS, "20 PARAM_REQUEST_READ, 21 PARAM_REQUEST_LIST"),
    **named(
        replace(ASKS, about="message rates of one client", is_claimed=True, elsewhere=ACTS),
        "66 REQUEST_DATA_STREAM",
    ),
    **named(
        replace(ASKS, about="requests a plan", is_claimed=True, elsewhere=ASKS),
        "37 MISSION_REQUEST_PARTIAL_LIST, 43 MISSION_REQUEST_LIST",
    ),
    **named(
        replace(
            ASKS,
            about="requests an item of a plan",
            is_claimed=True,
            is_counted=False,
            elsewhere=ASKS,
        ),
        "40 MISSION_REQUEST, 51 MISSION_REQUEST_INT",
    ),
    47: Row(
        "MISSION_ACK",
        Kind.TELL,
        OBSERVER,
        "end of a plan transfer",
        is_claimed=True,
        is_counted=False,
        elsewhere=Row("", Kind.TELL, OBSERVER),
    ),
    **named(
        replace(ASKS, role=OPERATOR, about="requests that are expensive to answer"),
        """117 LOG_REQUEST_LIST, 119 LOG_REQUEST_DATA, 122 LOG_REQUEST_END, 135 TERRAIN_CHECK,
        161 FENCE_FETCH_POINT, 176 RALLY_FETCH_POINT, 183 AUTOPILOT_VERSION_REQUEST,
        216 GOPRO_GET_REQUEST, 320 PARAM_EXT_REQUEST_READ, 321 PARAM_EXT_REQUEST_LIST,
        10006 UAVIONIX_ADSB_GET, 11035 OSD_PARAM_SHOW_CONFIG""",
    ),
    **named(UPLOADS, "38 MISSION_WRITE_PARTIAL_LIST, 44 MISSION_COUNT"),
    **named(replace(UPLOADS, is_counted=False), "39 MISSION_ITEM, 73 MISSION_ITEM_INT"),
    **named(
        replace(UPLOADS, role=OPERATOR, about="clears anybody's mission"), "45 MISSION_CLEAR_ALL"
    ),
    **named(
        Row(
            "",
            Kind.GO,
            SUBMITTER,
            "chooses an item of one's own plan",
            is_claimed=True,
            elsewhere=GOES,
        ),
        "41 MISSION_SET_CURRENT",
    ),
    **named(replace(GOES, about="any other mode"), "11 SET_MODE"),
    **named(
        Row("", Kind.HALT, SUBMITTER, "cancels one's own task", is_claimed=True),
        "80 COMMAND_CANCEL",
    ),
    **named(
        Row("", Kind.WISH, OBSERVER, "asks the server to sign to this client", is_claimed=True),
        "256 SETUP_SIGNING",
    ),
    **named(SETS, "23 PARAM_SET, 110 FILE_TRANSFER_PROTOCOL, 121 LOG_ERASE, 323 PARAM_EXT_SET"),
    **named(
        Row("", Kind.STICKS, OPERATOR, "manual control", is_counted=False),
        "69 MANUAL_CONTROL, 70 RC_CHANNELS_OVERRIDE",
    ),
    **named(
        replace(MOVES, about="setpoints", is_counted=False),
        """82 SET_ATTITUDE_TARGET, 84 SET_POSITION_TARGET_LOCAL_NED,
        86 SET_POSITION_TARGET_GLOBAL_INT, 139 SET_ACTUATOR_CONTROL_TARGET""",
    ),
    **named(
        replace(MOVES, about="follow-me targets; inputs of a radio, a simulator or a planner"),
        """34 RC_CHANNELS_SCALED, 35 RC_CHANNELS_RAW, 65 RC_CHANNELS, 81 MANUAL_SETPOINT,
        91 HIL_CONTROLS, 92 HIL_RC_INPUTS_RAW, 93 HIL_ACTUATOR_CONTROLS, 144 FOLLOW_TARGET,
        332 TRAJECTORY_REPRESENTATION_WAYPOINTS, 333 TRAJECTORY_REPRESENTATION_BEZIER,
        420 RADIO_RC_CHANNELS""",
    ),
    **named(
        CARRIES,
        """223 COMMAND_INT_STAMPED, 224 COMMAND_LONG_STAMPED, 248 V2_EXTENSION, 385 TUNNEL,
        386 CAN_FRAME, 387 CANFD_FRAME, 50004 CUBEPILOT_FIRMWARE_UPDATE_START,
        50005 CUBEPILOT_FIRMWARE_UPDATE_RESP""",
    ),
    **named(
        replace(BOUNDS, about="fence, the vehicle's shell, registers, keys, networks"),
        """5 CHANGE_OPERATOR_CONTROL, 7 AUTH_KEY, 50 PARAM_MAP_RC, 54 SAFETY_SET_ALLOWED_AREA,
        126 SERIAL_CONTROL, 151 SET_MAG_OFFSETS, 160 FENCE_POINT, 175 RALLY_POINT,
        299 WIFI_CONFIG_AP, 388 CAN_FILTER_MODIFY, 11000 DEVICE_OP_READ, 11002 DEVICE_OP_WRITE,
        11004 SECURE_COMMAND, 11033 OSD_PARAM_CONFIG""",
    ),
    **named(
        replace(BOUNDS, about="position estimates and sensor data for the vehicle"),
        """48 SET_GPS_GLOBAL_ORIGIN, 89 LOCAL_POSITION_NED_SYSTEM_GLOBAL_OFFSET, 90 HIL_STATE,
        100 OPTICAL_FLOW, 101 GLOBAL_VISION_POSITION_ESTIMATE, 102 VISION_POSITION_ESTIMATE,
        103 VISION_SPEED_ESTIMATE, 104 VICON_POSITION_ESTIMATE, 106 OPTICAL_FLOW_RAD,
        107 HIL_SENSOR, 113 HIL_GPS, 114 HIL_OPTICAL_FLOW, 115 HIL_STATE_QUATERNION,
        132 DISTANCE_SENSOR, 138 ATT_POS_MOCAP, 149 LANDING_TARGET, 232 GPS_INPUT,
        296 GLOBAL_POSITION_SENSOR, 330 OBSTACLE_DISTANCE, 331 ODOMETRY, 513 RANGING_BEACON,
        9000 WHEEL_DISTANCE, 11011 VISION_POSITION_DELTA, 11037 OBSTACLE_DISTANCE_3D""",
    ),
    **named(
        replace(ACTS, about="cameras, gimbals, lights, home, other traffic"),
        """123 GPS_INJECT_DATA, 130 DATA_TRANSMISSION_HANDSHAKE, 131 ENCAPSULATED_DATA,
        142 RESOURCE_REQUEST, 154 DIGICAM_CONFIGURE, 155 DIGICAM_CONTROL, 156 MOUNT_CONFIGURE,
        157 MOUNT_CONTROL, 186 LED_CONTROL, 201 GIMBAL_CONTROL, 218 GOPRO_SET_REQUEST,
        243 SET_HOME_POSITION, 246 ADSB_VEHICLE, 247 COLLISION, 258 PLAY_TUNE,
        282 GIMBAL_MANAGER_SET_ATTITUDE, 284 GIMBAL_DEVICE_SET_ATTITUDE,
        286 AUTOPILOT_STATE_FOR_GIMBAL_DEVICE, 287 GIMBAL_MANAGER_SET_PITCHYAW,
        288 GIMBAL_MANAGER_SET_MANUAL_CONTROL, 301 AIS_VESSEL, 340 UTM_GLOBAL_POSITION,
        10001 UAVIONIX_ADSB_OUT_CFG, 10002 UAVIONIX_ADSB_OUT_DYNAMIC,
        10007 UAVIONIX_ADSB_OUT_CONTROL""",
    ),
    **named(
        replace(ACTS, about="sent by vehicles and components; another vehicle might act on it"),
        """1 SYS_STATUS, 6 CHANGE_OPERATOR_CONTROL_ACK, 22 PARAM_VALUE, 24 GPS_RAW_INT,
        25 GPS_STATUS, 26 SCALED_IMU, 27 RAW_IMU, 28 RAW_PRESSURE, 29 SCALED_PRESSURE,
        30 ATTITUDE, 31 ATTITUDE_QUATERNION, 32 LOCAL_POSITION_NED, 33 GLOBAL_POSITION_INT,
        36 SERVO_OUTPUT_RAW, 42 MISSION_CURRENT, 46 MISSION_ITEM_REACHED, 49 GPS_GLOBAL_ORIGIN,
        55 SAFETY_ALLOWED_AREA, 61 ATTITUDE_QUATERNION_COV, 62 NAV_CONTROLLER_OUTPUT,
        63 GLOBAL_POSITION_INT_COV, 64 LOCAL_POSITION_NED_COV, 67 DATA_STREAM, 74 VFR_HUD,
        83 ATTITUDE_TARGET, 85 POSITION_TARGET_LOCAL_NED, 87 POSITION_TARGET_GLOBAL_INT,
        105 HIGHRES_IMU, 108 SIM_STATE, 112 CAMERA_TRIGGER, 116 SCALED_IMU2, 118 LOG_ENTRY,
        120 LOG_DATA, 124 GPS2_RAW, 125 POWER_STATUS, 127 GPS_RTK, 128 GPS2_RTK, 129 SCALED_IMU3,
        133 TERRAIN_REQUEST, 136 TERRAIN_REPORT, 137 SCALED_PRESSURE2,
        140 ACTUATOR_CONTROL_TARGET, 141 ALTITUDE, 143 SCALED_PRESSURE3,
        146 CONTROL_SYSTEM_STATE, 147 BATTERY_STATUS, 148 AUTOPILOT_VERSION, 162 FENCE_STATUS,
        192 MAG_CAL_REPORT, 225 EFI_STATUS, 230 ESTIMATOR_STATUS, 231 WIND_COV, 234 HIGH_LATENCY,
        235 HIGH_LATENCY2, 241 VIBRATION, 242 HOME_POSITION, 244 MESSAGE_INTERVAL,
        245 EXTENDED_SYS_STATE, 249 MEMORY_VECT, 250 DEBUG_VECT, 251 NAMED_VALUE_FLOAT,
        252 NAMED_VALUE_INT, 254 DEBUG, 257 BUTTON_CHANGE, 259 CAMERA_INFORMATION,
        260 CAMERA_SETTINGS, 261 STORAGE_INFORMATION, 262 CAMERA_CAPTURE_STATUS,
        263 CAMERA_IMAGE_CAPTURED, 264 FLIGHT_INFORMATION, 265 MOUNT_ORIENTATION,
        266 LOGGING_DATA, 267 LOGGING_DATA_ACKED, 269 VIDEO_STREAM_INFORMATION,
        270 VIDEO_STREAM_STATUS, 271 CAMERA_FOV_STATUS, 275 CAMERA_TRACKING_IMAGE_STATUS,
        276 CAMERA_TRACKING_GEO_STATUS, 277 CAMERA_THERMAL_RANGE, 280 GIMBAL_MANAGER_INFORMATION,
        281 GIMBAL_MANAGER_STATUS, 283 GIMBAL_DEVICE_INFORMATION,
        285 GIMBAL_DEVICE_ATTITUDE_STATUS, 295 AIRSPEED, 300 PROTOCOL_VERSION,
        310 UAVCAN_NODE_STATUS, 311 UAVCAN_NODE_INFO, 322 PARAM_EXT_VALUE, 324 PARAM_EXT_ACK,
        335 ISBD_LINK_STATUS, 339 RAW_RPM, 345 PARAM_ERROR, 350 DEBUG_FLOAT_ARRAY,
        360 ORBIT_EXECUTION_STATUS, 370 SMART_BATTERY_INFO, 373 GENERATOR_STATUS,
        375 ACTUATOR_OUTPUT_STATUS, 376 RELAY_STATUS, 390 ONBOARD_COMPUTER_STATUS,
        397 COMPONENT_METADATA, 410 EVENT, 435 AVAILABLE_MODES, 436 CURRENT_MODE,
        437 AVAILABLE_MODES_MONITOR, 9005 WINCH_STATUS, 12918 OPEN_DRONE_ID_ARM_STATUS,
        12920 HYGROMETER_SENSOR, 54000 TASK_STATUS, 54001 TASK_QUEUE_STATUS, 54002 TASK_TIMING""",
    ),
}
