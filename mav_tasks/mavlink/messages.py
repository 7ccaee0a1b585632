"""The only re-export of the generated classes, under readable names.

Constructor arguments and attributes are the field names of the MAVLink definitions. A class's
``id`` is its message id (an instance's may be a field: ask ``get_msgId()``). What is not listed
here is forwarded raw and never decoded.
"""

from mav_tasks.mavlink import _dialect as d

Message = d.MAVLink_message

Attitude = d.MAVLink_attitude_message
AutopilotVersion = d.MAVLink_autopilot_version_message
AvailableModes = d.MAVLink_available_modes_message
BatteryStatus = d.MAVLink_battery_status_message
CommandAck = d.MAVLink_command_ack_message
CommandCancel = d.MAVLink_command_cancel_message
CommandInt = d.MAVLink_command_int_message
CommandLong = d.MAVLink_command_long_message
ComponentMetadata = d.MAVLink_component_metadata_message
CurrentMode = d.MAVLink_current_mode_message
Event = d.MAVLink_event_message
ExtendedSysState = d.MAVLink_extended_sys_state_message
FileTransferProtocol = d.MAVLink_file_transfer_protocol_message
FollowTarget = d.MAVLink_follow_target_message
GlobalPositionInt = d.MAVLink_global_position_int_message
GpsGlobalOrigin = d.MAVLink_gps_global_origin_message
GpsRawInt = d.MAVLink_gps_raw_int_message
Heartbeat = d.MAVLink_heartbeat_message
HomePosition = d.MAVLink_home_position_message
LocalPositionNed = d.MAVLink_local_position_ned_message
ManualControl = d.MAVLink_manual_control_message
MessageInterval = d.MAVLink_message_interval_message
MissionAck = d.MAVLink_mission_ack_message
MissionClearAll = d.MAVLink_mission_clear_all_message
MissionCount = d.MAVLink_mission_count_message
MissionCurrent = d.MAVLink_mission_current_message
MissionItem = d.MAVLink_mission_item_message
MissionItemInt = d.MAVLink_mission_item_int_message
MissionItemReached = d.MAVLink_mission_item_reached_message
MissionRequest = d.MAVLink_mission_request_message
MissionRequestInt = d.MAVLink_mission_request_int_message
MissionRequestPartialList = d.MAVLink_mission_request_partial_list_message
MissionRequestList = d.MAVLink_mission_request_list_message
MissionSetCurrent = d.MAVLink_mission_set_current_message
MissionWritePartialList = d.MAVLink_mission_write_partial_list_message
ParamError = d.MAVLink_param_error_message
ParamRequestList = d.MAVLink_param_request_list_message
ParamRequestRead = d.MAVLink_param_request_read_message
ParamSet = d.MAVLink_param_set_message
ParamValue = d.MAVLink_param_value_message
Ping = d.MAVLink_ping_message
PositionTargetGlobalInt = d.MAVLink_position_target_global_int_message
PositionTargetLocalNed = d.MAVLink_position_target_local_ned_message
ProtocolVersion = d.MAVLink_protocol_version_message
RcChannels = d.MAVLink_rc_channels_message
RcChannelsOverride = d.MAVLink_rc_channels_override_message
RequestDataStream = d.MAVLink_request_data_stream_message
SetActuatorControlTarget = d.MAVLink_set_actuator_control_target_message
SetAttitudeTarget = d.MAVLink_set_attitude_target_message
SetupSigning = d.MAVLink_setup_signing_message
SetGpsGlobalOrigin = d.MAVLink_set_gps_global_origin_message
SetMode = d.MAVLink_set_mode_message
SetPositionTargetGlobalInt = d.MAVLink_set_position_target_global_int_message
SetPositionTargetLocalNed = d.MAVLink_set_position_target_local_ned_message
Statustext = d.MAVLink_statustext_message
SystemTime = d.MAVLink_system_time_message
SysStatus = d.MAVLink_sys_status_message
TaskQueueStatus = d.MAVLink_task_queue_status_message
TaskStatus = d.MAVLink_task_status_message
TaskTiming = d.MAVLink_task_timing_message
Timesync = d.MAVLink_timesync_message
VfrHud = d.MAVLink_vfr_hud_message

ALL: dict[int, type[Message]] = d.mavlink_map
"""Every message that the dialect defines, by id."""

TARGETED = frozenset(id_ for id_, kind in ALL.items() if "target_system" in kind.fieldnames)
"""The ids of those that name whom they are for."""
