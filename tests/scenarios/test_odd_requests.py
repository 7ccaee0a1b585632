"""Requests that make no sense, or come at the wrong time: each gets its answer and its words."""

from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Clients, Driving, Queueing, Roles, Settings, Watch
from mav_tasks.engine.inputs import Congestion, Packets, PeerChanged
from mav_tasks.mavlink.enums import MavAutopilot
from mav_tasks.shell.in_memory import CLIENT_LINK, VEHICLE_LINK
from mav_tasks.tasks.events import SubmissionRefused
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import Faults
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, DENIED, command_long
from tests.kit.mission import Download
from tests.kit.px4 import PROMPT_PX4
from tests.kit.restarts import UTC, restart
from tests.kit.rows import ask, check
from tests.kit.store import LateStore, PromptSqliteStore
from tests.kit.world import PROMPT, World, at
from tests.scenarios.conftest import MakeWorld
from tests.scenarios.test_car import car_profile
from tests.scenarios.test_plan_commands import ARDUPILOT_CAR

SECOND_CAR = replace(ARDUPILOT_CAR, system_id=2, uid="2")
PAIR = "NAV_WAYPOINT; NAV_WAYPOINT at=2,0"
HOW_IT_TURNS = ("CA_AIRFRAME", "SYS_AUTOSTART")
UNKNOWN_PX4 = replace(
    PROMPT_PX4, parameters=tuple(p for p in PROMPT_PX4.parameters if p.name not in HOW_IT_TURNS)
)


@for_each(
    "kw, table",
    [
        (
            {},
            """
SET_MESSAGE_INTERVAL -5 : DENIED param1 -5 is not a message id
SET_MESSAGE_INTERVAL 30 nan : DENIED param2 interval nan is not finite
GET_MESSAGE_INTERVAL 70000 : DENIED param1 message id 70000 not in 0..65535
GET_MESSAGE_INTERVAL 54000 : ACCEPTED MESSAGE_INTERVAL@191
param_request_read to=server _HASH_CHECK -1 : - PARAM_VALUE@191
setup_signing to=other KEY 0 : -
client:file_transfer_protocol 0 1 191 0,0,0,128,ZEROS : -
REQUEST_MESSAGE 54002 77 : DENIED no task 77
REQUEST_MESSAGE 54002 : DENIED no task runs
DO_SET_MODE 1 nan to=autopilot : DENIED param2 nan is not a mode number
DO_CHANGE_SPEED 1 nan : DENIED param2 speed is not given
DO_CHANGE_SPEED 1 -1 : ACCEPTED
MISSION_START 0 3 : DENIED param2 last item 3: only the whole plan can run
MISSION_START : DENIED there is no mission: upload one first
DO_SET_MISSION_CURRENT 1 : DENIED there is no mission: upload one first
TASK_MOVE 1 0 0 0 0 60 : ACCEPTED #1
TASK_CANCEL 9 : DENIED no task 9
TASK_CANCEL 9 confirmation=1 : DENIED just refused; send it again if you mean it
TASK_CANCEL 8 confirmation=1 : DENIED no task 8
TASK_RELEASE 1 : DENIED task 1 is not held, it is scheduled
TASK_MODIFY 1 7 0 0 99 : DENIED START_UTC must be sent as COMMAND_INT
TASK_MODIFY 1 8 0 0 99 : DENIED LABEL must be sent as COMMAND_INT
TASK_MODIFY 1 8 3 0 x=-1 y=-1 : DENIED label: byte 3 comes after byte 0
TASK_MODIFY 1 9 60 : ACCEPTED
TASK_MODIFY 1 9 60 0 0 0 1 : ACCEPTED
mission; NAV_WAYPOINT; NAV_WAYPOINT at=1,0 : ACCEPTED #2
TASK_MODIFY 2 9 60 : DENIED task 2 needs a start command: it cannot repeat
ARM 1 : ACCEPTED
fault refuse_arm=1 : -
ARM 0 : ACCEPTED
ARM 1 : FAILED
fault : -
lose 77 : -
ARM 1 & ARM 1 21196 : -
ARM 0 21196 & ARM 0 21196 : BUSY+BUSY is busy, try again
wait 5.4 : BUSY+BUSY no answer
TASK_STOP : ACCEPTED
NAV_LAND : BUSY STOP is in force: press Continue first
""",
        ),
        (
            {},
            """
TASK_MOVE 0.2 : ACCEPTED
wait 4.4 : - Task 1 done
TASK_CANCEL 99 : DENIED no task 99
TASK_CANCEL 0 : DENIED no task is running
TASK_CANCEL -1 : DENIED param1 task -1
TASK_CANCEL 1.5 : DENIED param1 task 1.5
TASK_CANCEL nan : DENIED param1 task
TASK_CANCEL 1 2 : DENIED param2 kill
TASK_CANCEL 1 : DENIED task 1 has ended (completed)
""",
        ),
        (
            {"settings": Settings(claim=False)},
            """
DO_SET_MODE 1 15 to=autopilot : ACCEPTED
ARM 1 : ACCEPTED
NAV_SET_YAW_SPEED 90 nan to=autopilot : DENIED param2 speed is not given
""",
        ),
        (
            {},
            """
mission_request_list 7 : UNSUPPORTED
mission_clear_all 7 : UNSUPPORTED
mission_count 1 7 : UNSUPPORTED mission type 7 is not supported
mission_count 60000 : NO_SPACE items
mission_request_partial_list 0 2 : UNSUPPORTED
mission_write_partial_list 0 2 : UNSUPPORTED
mission_request_int 5 : INVALID_SEQUENCE
mission_set_current 5 : - there is no mission: upload one first
mission_item_int 0 3 16 3 1 0 0 0 0 5 5 9 : ACCEPTED
fence; NAV_FENCE_RETURN_POINT at=1,1 frame=99 : UNSUPPORTED_FRAME frame 99
fence; NAV_FENCE_RETURN_POINT x=900000001 y=5 : INVALID_PARAM5_X x latitude 90.0000001
fence; NAV_FENCE_RETURN_POINT x=5 y=1800000001 : INVALID_PARAM6_Y y longitude 180.0000001
fence; NAV_FENCE_RETURN_POINT 0 1.5 at=1,1 : INVALID_PARAM2 param2 group 1.5 not in 0..255
fence; NAV_FENCE_RETURN_POINT 0 nan at=1,1 : ACCEPTED
rally; NAV_WAYPOINT at=1,1 : UNSUPPORTED rally points
plan; NAV_WAYPOINT at=1,1 frame=99 : UNSUPPORTED_FRAME item 1: frame 99 is unknown
plan; TASK_MOVE 1 x=9 : INVALID_PARAM5_X param5 run after: not in a plan
plan; JUMP_TAG 5; DO_JUMP_TAG 5 2 : INVALID a loop without motion
plan; NAV_WAYPOINT x=2147483647; NAV_LOITER_TURNS 1 0 1 : ACCEPTED #1
mission; NAV_WAYPOINT; NAV_WAYPOINT at=1,0; DO_SET_SERVO 1 frame=2 : ACCEPTED #2
mission_request_list 0 : - MISSION_COUNT@1
mission_request 2 : - MISSION_ITEM@1
wait 40 & mission_request_list 0 : - MISSION_COUNT@1
MISSION_START 9 : DENIED param1 first item 9: the plan has 3 items
mission_set_current 9 : - item 9: the last item is 2
mission_set_current 1 : -
mission_count 1 : -
mission_ack 15 : -
mission_count 1 : -
mission_item 0 3 16 0 1 0 0 0 0 1e30 5 5 : INVALID_PARAM5_X
mission_count 1 : -
mission_item_int 0 2 178 0 1 0 0.5 0 0 0 0 0 : ACCEPTED
mission_item_int 0 2 178 0 1 0 0.5 0 0 0 0 0 : ACCEPTED
lose 40 : -
fence; NAV_FENCE_CIRCLE_INCLUSION 9 at=1,1 : -
rover:mission_request_int 250 191 0 2 : -
rover:mission_ack 250 191 1 1 : DENIED rover 1 refused it: ERROR
lose 47 : -
fence; NAV_FENCE_CIRCLE_INCLUSION 9 at=1,1 : -
wait 10.4 : ERROR rover 1 did not answer: not stored
lose 77 : -
plan; DO_SET_SERVO 1 1500 : ACCEPTED
wait 10.4 : - did not answer command 183 of the plan
""",
        ),
        (
            {},
            """
fence; POND 4 at=1,-1; POND 4 at=2,-1; POND 4 at=2,1; POND 4 at=1,1 : ACCEPTED
plan; GO at=0.5,0; GO at=0.5,2; GO at=3,2; GO at=3,0; DO_JUMP 1 2 : DENIED a jump to it crosses
plan to=any; GO at=0.5,0; GO at=2.5,0 : UNSUPPORTED the path crosses the fence
""",
        ),
        (
            {},
            """
rover:mission_current 0 5 0 0 : - has its own mission on board (5 items)
rover:gps_global_origin 910000000 0 0 : -
rover:rc_channels 1 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 : -
rover:param_value SERVO1_FUNCTION nan 9 1 1 : -
rover:autopilot_version 0 0 0 0 0 EIGHT EIGHT EIGHT 0 0 1 : -
TASK_MOVE 0.2 : ACCEPTED #1
wait 4.4 : - Task 1 done
TASK_MOVE 9 : ACCEPTED #2
wait 2 & ARM 0 21196 to=autopilot : ACCEPTED Task 2 stopped for good
MANY_TEXTS : - 0000000041
""",
        ),
        (
            {},
            """
mission; NAV_WAYPOINT; NAV_WAYPOINT at=0.2,0; NAV_WAYPOINT at=0.3,0 : ACCEPTED #1
MISSION_START 2 : ACCEPTED
mission : DENIED task 1 has started: cancel it first
wait 8.4 : - Task 1 done
mission_set_current 1 : - The mission will start with item 1
DO_SET_MISSION_CURRENT 1 : ACCEPTED The mission will start with item 1
plan; NAV_WAYPOINT 60 x=2147483647 : ACCEPTED #2
MISSION_START : ACCEPTED
wait 1.4 : -
fault position_jump=50,0 : -
wait 1.4 : -
MISSION_START : ACCEPTED
fault : -
wait 1.4 : -
TASK_RELEASE 2 2 : ACCEPTED
TASK_RELEASE 2 2 : ACCEPTED task 2: already skipped
DO_SET_MODE 1 11 to=autopilot : ACCEPTED #3
DO_SET_MODE 1 11 to=autopilot : ACCEPTED
""",
        ),
        (
            {"settings": Settings(profiles=(replace(ARDUPILOT_CAR, speed=0.5),))},
            """
TASK_DRIVE 0 20 1 : DENIED param2 yaw rate: rover 1 steers like a car
NAV_SET_YAW_SPEED 90 0 : DENIED param2 speed 0: rover 1 steers like a car
TASK_MOVE 0.3 : ACCEPTED #1
wait 5.4 : - Task 1 done
""",
        ),
        (
            {"persona": PROMPT_PX4, "settings": Settings(profiles=(car_profile(PROMPT_PX4),))},
            """
TASK_DRIVE 1 20 1 : DENIED is steered by course and cannot follow
plan; DO_SET_REVERSE 1; NAV_WAYPOINT at=1,0 : INVALID_PARAM1 leave DO_SET_REVERSE out
""",
        ),
        (
            {},
            """
SET_MESSAGE_INTERVAL 24 100000 : ACCEPTED
wait 2.4 : - GPS_RAW_INT@1
lose 77 & SET_MESSAGE_INTERVAL 24 0 : ACCEPTED
wait 5.4 : - GPS_RAW_INT@1
unread & TASK_MOVE 1 to=any & wait 4 & read : BUSY delayed by the server: send it again
mission; NAV_WAYPOINT; NAV_WAYPOINT at=9,0 : ACCEPTED
MISSION_START : ACCEPTED
wait 3 & fault position_jump=50,0 & wait 1.4 : -
unread & mission_clear_all 0 & wait 2 & read : DENIED clear: delayed by the server
""",
        ),
        (
            {},
            """
fault deaf=1 & SET_MESSAGE_INTERVAL 24 100000 & SET_MESSAGE_INTERVAL 230 100000 : ACCEPTED+ACCEPTED
wait 1 & rover:command_ack 511 2 0 0 250 191 : -
wait 1 & rover:command_ack 511 2 0 0 250 191 : -
wait 1 & rover:command_ack 511 2 0 0 250 191 : -
fault : -
wait 2.4 : - GPS_RAW_INT@1
""",
        ),
        (
            {"persona": replace(PROMPT_PX4, autopilot=MavAutopilot.GENERIC)},
            """
TASK_MOVE 4 : ACCEPTED #1
wait 3.4 : -
fault refuse_mode=1 & TASK_STOP : ACCEPTED
wait 4.4 : - Disarmed
""",
        ),
        (
            {"persona": UNKNOWN_PX4},
            """
NAV_SET_YAW_SPEED 90 0 : DENIED param2 speed 0: rover 1 can neither turn on
TASK_ROTATE 90 : DENIED rover 1 can neither turn on the spot nor follow
""",
        ),
        (
            {"rovers": 2},
            """
TASK_MOVE 1 to=other : -
DO_CHANGE_SPEED 1 1 to=any : -
TASK_CANCEL 1 to=any : DENIED command 54010 must name one rover
mission_count 1 1 to=any : UNSUPPORTED belongs to one rover: name it
fence to=any; NAV_WAYPOINT at=1,0 : UNSUPPORTED belongs to one rover
TASK_MOVE 1 0 0 9 0 60 to=any : ACCEPTED #1 / Rover 1 chosen: free
again : ACCEPTED #1
fault battery=12 : -
wait 6.4 : - battery 12%
""",
        ),
        (
            {"rovers": 2, "settings": Settings(profiles=(SECOND_CAR,))},
            """
TASK_MOVE 3 & TASK_MOVE 9 to=second : ACCEPTED+ACCEPTED
NAV_WAYPOINT 0 0 0 90 to=any at=0,1 frame=0 : ACCEPTED Rover 1 chosen
fault battery=12 : -
wait 6.4 : -
""",
        ),
        (
            {"rovers": 2},
            """
TASK_STOP to=second : ACCEPTED
TASK_MOVE 1 0 0 0 0 60 to=any : ACCEPTED Rover 1 chosen: free
fault battery=12 : -
wait 6.4 : -
""",
        ),
        (
            {},
            """
lose 77 & TASK_MOVE 0.5 : ACCEPTED #1
wait 8.4 : - Task 1 done
lose 200 & TASK_MOVE 0.5 : ACCEPTED #2
wait 2 & fault refuse_mode=1 & wait 8.4 : - Task 2 done
fault : -
TASK_MOVE 9 : ACCEPTED #3
wait 2 & operator rtl & wait 1.4 : - Task 3
rover:statustext 4 LONG 7 0 & rover:statustext 4 LONGER 7 0 : - failsafe: Failsafexxxx / x[?]
""",
        ),
        (
            {"realism": replace(PROMPT.realism, tells_origin=False)},
            """
rover:gps_global_origin -353632620 1491652370 0 : -
NAV_WAYPOINT at=0.3,0 frame=0 & wait 7.4 : ACCEPTED Task 1 done
fault withheld=33,49,242 & reboot & wait 12.4 : - Rover 1 restarted
NAV_WAYPOINT at=1,0 frame=0 : ACCEPTED Task 2 waits: no valid position
REQUEST_MESSAGE 54000 2 & TASK_CANCEL 2 : ACCEPTED+ACCEPTED
plan; GO x=30000 y=0 frame=1; GO at=6,0; GO at=7,0 : ACCEPTED #3
wait 12.4 : - Task 3 paused: position lost
fault & wait 15.4 : - Task 3 done
""",
        ),
        (
            {"settings": Settings(roles=Roles("observer"))},
            """
mission_item_int 0 3 16 0 1 0 0 0 0 5 5 9 : -
mission_count 1 : DENIED role observer may not
""",
        ),
        (
            {"settings": Settings(roles=Roles("submitter"))},
            """
DO_PAUSE_CONTINUE 0 : ACCEPTED
wait 4.4 : -
DO_REPOSITION -1 1 0 nan at=1,0 frame=0 : ACCEPTED Task 1 waits, press Continue
CLICK at=2,0 frame=0 : ACCEPTED Task 2 waits, press Continue
""",
        ),
        (
            {"persona": PROMPT_PX4},
            """
mission; GO at=1,0 : ACCEPTED
DO_SET_MODE 1 4 4 to=autopilot : ACCEPTED The mission starts when the rover is armed
TASK_STOP : ACCEPTED
DO_PAUSE_CONTINUE 1 : ACCEPTED
ARM 1 : ACCEPTED
""",
        ),
        (
            {"persona": PROMPT_PX4},
            """
mission; GO at=1,0 : ACCEPTED
DO_SET_MODE 1 4 4 to=autopilot : ACCEPTED The mission starts when the rover is armed
mission; GO at=2,0 : ACCEPTED
ARM 1 : ACCEPTED
""",
        ),
        (
            {},
            """
TASK_MOVE 9 : ACCEPTED #1
wait 3 & fault position_jump=50,0 & wait 1.4 : - Task 1 held: position reference changed
TASK_MOVE 1 to=any : BUSY no rover can: rover 1: a task is held
fault & wait 5.4 : -
DO_PAUSE_CONTINUE 0 & wait 5.4 : ACCEPTED
CLICK at=5,0 frame=0 : ACCEPTED #2
TASK_RELEASE 1 0 : DENIED task 2 is executing: release task 1 later
TASK_MOVE 1 : ACCEPTED Task 3 waits, press Continue
REQUEST_MESSAGE 54000 3 : ACCEPTED
DO_PAUSE_CONTINUE 0 & wait 5.4 : ACCEPTED Task 2 paused
TASK_RELEASE 1 0 : ACCEPTED Task 1 waits: released
DO_PAUSE_CONTINUE 1 & wait 3.4 : ACCEPTED task 1 is next
fault position_jump=50,0 & wait 1.4 : - Task 1 held / Task 2 held
fault & wait 5 & DO_PAUSE_CONTINUE 0 & wait 5.4 : ACCEPTED
CLICK at=6,0 frame=0 : ACCEPTED #4
TASK_STOP : ACCEPTED Task 4 stopped for good
wait 5 & TASK_RELEASE 1 0 : BUSY STOP is in force: press Continue first
TASK_CANCEL 1 : ACCEPTED Task 1 cancelled
""",
        ),
        (
            {},
            """
fault refuse_arm=1 : -
TASK_MOVE 1 : ACCEPTED #1
DO_CHANGE_SPEED 1 0.3 : ACCEPTED
wait 1 & fault refuse_arm=1 position_jump=50,0 & wait 2.4 : - not ready to arm
fault & wait 9.4 : - Task 1 done
DO_SET_MODE 1 11 to=autopilot & wait 3 & DO_PAUSE_CONTINUE 0 : ACCEPTED+ACCEPTED Task 2 paused
wait 5 & DO_PAUSE_CONTINUE 1 : ACCEPTED task 2 is next, return home
wait 9.4 : - Task 2 done
plan; GO at=1,0; NAV_SET_YAW_SPEED 45 0.5 : ACCEPTED #3
wait 7 & DO_CHANGE_SPEED 1 0.4 : ACCEPTED
TASK_CANCEL 0 & TASK_MOVE 1 to=any : ACCEPTED+ACCEPTED Rover 1 chosen: free in
wait 9.4 : - Task 3 cancelled / Task 4 done
plan; GO x=50000 y=0 frame=1 : ACCEPTED
wait 3 & reboot & wait 8.4 : - Task 5 held
TASK_RELEASE 5 1 : DENIED the position reference of task 5 is lost
""",
        ),
        (
            {},
            """
TASK_MOVE 1 0 0 0 0 60 : ACCEPTED #1
TASK_MOVE 2 0 0 0 1 10 : ACCEPTED #2
TASK_MOVE 0.3 to=any & wait 4.4 : ACCEPTED Rover 1 chosen: free
DO_PAUSE_CONTINUE 0 : ACCEPTED
TASK_MOVE 3 : ACCEPTED #4
TASK_MOVE 2 0 0 0 4 : ACCEPTED #5
TASK_MODIFY 4 3 12 & TASK_MODIFY 5 3 13 : ACCEPTED+ACCEPTED
sleep 20 : - Task 4 expired: deadline / Task 5 failed: dependency failed
NAV_WAYPOINT at=1,0 frame=0 : ACCEPTED #6
NAV_WAYPOINT x=10000 y=0 frame=1 : ACCEPTED repeated goal, no new task: see task 6
NAV_WAYPOINT 1 x=10000 y=1 frame=1 : ACCEPTED #7
NAV_WAYPOINT x=10000 y=1 frame=1 : ACCEPTED #8
TASK_MOVE 1.1 & TASK_MOVE 1.2 & TASK_MOVE 1.3 : ACCEPTED+ACCEPTED+ACCEPTED
TASK_MOVE 2.1 & TASK_MOVE 2.2 & TASK_MOVE 2.3 : ACCEPTED+ACCEPTED+ACCEPTED
TASK_MOVE 3.1 & TASK_MOVE 3.2 & TASK_MOVE 3.3 : ACCEPTED+ACCEPTED+ACCEPTED
TASK_MOVE 4.1 & TASK_MOVE 4.2 & TASK_MOVE 4.3 : ACCEPTED+ACCEPTED+ACCEPTED
TASK_MOVE 5.1 & TASK_MOVE 5.2 & TASK_MOVE 5.3 : ACCEPTED+ACCEPTED+ACCEPTED
TASK_MOVE 6.1 & TASK_MOVE 6.2 & TASK_MOVE 6.3 : ACCEPTED+ACCEPTED+ACCEPTED
TASK_MOVE 1 to=any : BUSY no rover can: rover 1: queue paused
""",
        ),
        (
            {},
            """
TASK_MOVE 9 & wait 2 & operator rtl & wait 1.4 : ACCEPTED Task 1 paused: takeover
DO_PAUSE_CONTINUE 0 & rover:statustext 4 Failsafe 0 0 : ACCEPTED was taken over by its failsafe
operator hold & wait 4 & TASK_CANCEL 1 & DO_PAUSE_CONTINUE 1 : ACCEPTED+ACCEPTED
plan; GO at=3,0; CONDITION_DELAY 2; DO_SET_SERVO 1 1 & wait 15 : ACCEPTED Task 2 done / command 183
TASK_MOVE 1 & fault silent=1 deaf=1 & wait 5.4 : ACCEPTED Task 3 paused: position lost
reboot & fault & wait 20.4 : - Rover 1 restarted / Task 3 done
fault deaf=1 & reboot & wait 4.4 : - Rover 1 restarted
rover:command_ack 511 2 0 0 250 191 : -
rover:command_ack 511 2 0 0 250 191 : -
fault & wait 2.4 : - LOCAL_POSITION_NED@1
""",
        ),
        (
            {},
            """
operator rtl & wait 1 & TASK_MOVE 2 : ACCEPTED #1
TASK_MODIFY 1 3 2 : ACCEPTED
sleep 5 : - Task 1 expired: deadline
operator hold & wait 4 & ARM 1 & wait 1 & DO_SET_MODE 1 15 to=autopilot : ACCEPTED+ACCEPTED
client:set_position_target_local_ned 0 1 1 8 1479 0 0 0 0.1 0 0 0 0 0 0 0 : -
TASK_MOVE 1 to=any : BUSY no rover can: rover 1: a client drives it
operator manual & wait 4 & TASK_MOVE 1 to=any : BUSY no rover can: rover 1: wrong mode
""",
        ),
        (
            {},
            """
plan; GO at=1,0; GO at=2,0; GO at=2,4; GO at=2,8 : ACCEPTED #1
wait 2.4 : -
fence; POND 4 at=1.5,5; POND 4 at=2.5,5; POND 4 at=2.5,6; POND 4 at=1.5,6 : ACCEPTED
wait 22.4 : - would leave the fence in task 1 / Task 1 held: stopped at the fence
TASK_CANCEL 1 & wait 2 & CLICK at=0,0 frame=0 : ACCEPTED+ACCEPTED #2
CLICK at=0,9 frame=0 : ACCEPTED #3
TASK_STOP : ACCEPTED Task 2 stopped for good / Task 3 stopped for good
wait 4 & DO_PAUSE_CONTINUE 1 & TASK_MOVE -4 & wait 3.4 : ACCEPTED+ACCEPTED Task 4 started
TASK_CANCEL 0 & reboot & wait 3.4 : ACCEPTED Task 4 cancelled / Rover 1 restarted
""",
        ),
        (
            {
                "settings": Settings(
                    watch=Watch(position_lost=9, start_timeout=3, heartbeat_lost=9),
                    queueing=Queueing(capacity=1),
                    driving=Driving(max_distance=5),
                )
            },
            """
fault refuse_mode=1 withheld=30,32 & TASK_MOVE 0.1 & wait 0.4 & BLIND & wait 2.4 : ACCEPTED #1
fault & wait 9.4 : - Task 1 done
TASK_MOVE -4 : ACCEPTED #2
NAV_WAYPOINT at=3,0 frame=0 : ACCEPTED #3
TASK_MOVE 1 to=any : BUSY no rover can: rover 1: queue full
wait 15.4 : - Task 2 done / Task 3 failed: bad parameter
lose 0 & TASK_MOVE 4 & wait 3.4 : ACCEPTED Task 4 failed: start timeout
""",
        ),
        (
            {
                "persona": PROMPT_PX4,
                "settings": Settings(watch=Watch(ready_timeout=5), queueing=Queueing(capacity=1)),
            },
            """
mission; GO at=0.3,0 & wait 1.4 : ACCEPTED #1
DO_SET_MODE 1 4 4 to=autopilot & wait 1 & ARM 1 & wait 9.4 : ACCEPTED+ACCEPTED Task 1 done
ARM 0 & wait 5 & TASK_MOVE 1 0 0 0 0 60 : ACCEPTED+ACCEPTED #2
DO_SET_MODE 1 4 4 to=autopilot & wait 1 & ARM 1 & wait 1.4 : ACCEPTED+ACCEPTED queue full: 1
TASK_CANCEL 2 & ARM 0 & wait 5 & DO_PAUSE_CONTINUE 1 : ACCEPTED+ACCEPTED+ACCEPTED
fault refuse_arm=1 : -
TASK_MOVE 3 & wait 1.4 : ACCEPTED not ready to arm
rover:param_value COM_OBL_RC_ACT 1 9 1 1 : - keeps moving when setpoints stop
fault & wait 9.4 : - Task 3 failed: loss failsafe
""",
        ),
        (
            {"persona": PROMPT_PX4, "settings": Settings(yaw_rate="honoured")},
            """
TASK_ROTATE 10 : ACCEPTED #1
wait 5.4 : - Task 1 failed: stuck
""",
        ),
        (
            {
                "persona": PROMPT_PX4,
                "settings": Settings(watch=Watch(commit=5)),
                "store": LateStore(delay=1.0),
            },
            """
TASK_MOVE 9 to=any & again & wait 4.4 : ACCEPTED Task 1 started
HOLD & CLICK at=5,0 frame=0 : ACCEPTED Task 1 paused
BLIND & wait 3.4 : ACCEPTED stays paused: cannot start: no position
fault & wait 5 & DO_PAUSE_CONTINUE 1 & wait 3.4 : ACCEPTED Task 1 started
HOLD & CLICK at=6,0 frame=0 : ACCEPTED Task 1 paused
TASK_STOP & wait 3.4 : ACCEPTED+ACCEPTED Task 3 waits, press Continue (STOP in force)
""",
        ),
    ],
)
def test_each_has_its_answer(make_world: MakeWorld, kw: dict[str, Any], table: str) -> None:
    check(make_world(**kw), table)


@for_each("request", [f"plan; {PAIR}", f"mission; {PAIR}", "DO_SET_MODE 1 11 to=autopilot"])
def test_a_plan_that_is_not_stored_in_time(make_world: MakeWorld, request: str) -> None:
    store = LateStore()
    world = make_world(store=store)
    check(world, "mission; NAV_WAYPOINT; NAV_WAYPOINT at=1,0 : ACCEPTED")
    store.delay = inf
    ask(world, request)
    world.run(0.4)
    ask(world, "mission_count 2")
    world.run(5)
    assert world.client.said("not stored in time: not accepted")
    assert world.states() == [S.BLOCKED]
    download = Download(world.client)
    world.run(1)
    assert download.items[1].x == at(1, 0)["x"]


def test_a_flood_of_refusals_is_answered_and_not_told(world: World) -> None:
    requests = (
        "TASK_CANCEL 1 to=any",
        "TASK_CANCEL 1",
        "mission_item_int 0 3 21 2 1 0 0 0 0 5 5 9",
        "mission_set_current 9",
    )
    for _ in range(100):
        for each in requests:
            ask(world, each)
        world.run(0.001)
    world.run(1)
    assert world.client.acks_of(54_010) == [(DENIED, R.BAD_PARAMETER), (DENIED, R.NOT_FOUND)] * 100
    assert len(world.events(SubmissionRefused)) < 30


@for_each(
    "table",
    [
        """
TASK_ROTATE 270 & wait 4.4 : ACCEPTED #1
RESTART
wait 4 & TASK_RELEASE 1 1 : DENIED the progress of task 1 is unknown
fault silent=1 & wait 5 & TASK_RELEASE 1 0 : ACCEPTED Task 1 waits: the rover is silent
wait 25.4 : - holds task 1 again: waited too long (rover silent). Release it again
""",
        """
TASK_MOVE 9 & wait 3.4 : ACCEPTED #1
RESTART
fault position_jump=0,3 & wait 6 & TASK_RELEASE 1 1 : DENIED the rover is off the path of task 1
""",
        """
TASK_MOVE 3 0 0 0 0 0 1 & wait 3.4 : ACCEPTED #1
TASK_MOVE -1 0 0 0 0 0 9 & wait 2 & reboot : ACCEPTED Task 1 paused: preempted
RESTART
wait 9 & TASK_CANCEL 2 : ACCEPTED
wait 9 & DO_PAUSE_CONTINUE 1 : ACCEPTED Task 1 held: position reference changed
""",
        """
DO_PAUSE_CONTINUE 0 & TASK_MOVE 1 & TASK_ROTATE 9 : ACCEPTED+ACCEPTED+ACCEPTED
TASK_MODIFY 1 4 2 : ACCEPTED
RESTART
wait 4 & DO_PAUSE_CONTINUE 1 & wait 9.4 : ACCEPTED Task 2 done / Task 1 started
""",
        """
DO_PAUSE_CONTINUE 0 : ACCEPTED
TASK_MOVE 1 0 0 77 : ACCEPTED #1
TASK_MOVE 2 : ACCEPTED #2
RESTART
again : ACCEPTED #2
TASK_MOVE 1 0 0 77 : ACCEPTED #1
TASK_MOVE 3 0 0 77 : DENIED nonce 77 was used for another task
TASK_MOVE 2 confirmation=1 : ACCEPTED #2
TASK_MOVE 4 : ACCEPTED #3
""",
        """
TASK_MOVE 2 & wait 3.4 : ACCEPTED #1
RESTART
wait 4 & DO_PAUSE_CONTINUE 1 : ACCEPTED #0 / keeps task 1 on hold: press
wait 3 & DO_PAUSE_CONTINUE 1 : DENIED #112 / task 1 is held / release it (again
""",
        """
TASK_MOVE 1 0 0 7 0 600 to=any & fault silent=1 : ACCEPTED Rover 1 chosen
RESTART
REQUEST_MESSAGE 242 : -
REQUEST_MESSAGE 54000 1 to=any : ACCEPTED
REQUEST_MESSAGE 54002 1 to=second : ACCEPTED
TASK_MOVE 1 0 0 7 0 600 to=any : ACCEPTED
""",
    ],
)
def test_requests_after_a_crash(make_world: MakeWorld, path: Path, table: str) -> None:
    queueing, watch = Queueing(preemption_gap=3, preemption_rest=0.3), Watch(ready_timeout=20)
    store = PromptSqliteStore(path, wall_offset=UTC)
    world = make_world(rovers=2, store=store, settings=Settings(queueing=queueing, watch=watch))
    before, _, after = table.partition("RESTART\n")
    check(world, before)
    restart(world, path, away=0.0, settles=1.0)
    check(world, after)


def test_a_client_has_the_priority_of_its_address(make_world: MakeWorld) -> None:
    clients = Clients(priorities={"255/190": 7})
    world = make_world(settings=Settings(clients=clients))
    check(world, "NAV_WAYPOINT at=1,0 frame=0 : ACCEPTED")
    assert world.task(1).priority == 7


@for_each("delay", [0.3, inf])
def test_a_client_that_is_gone_is_not_answered(make_world: MakeWorld, delay: float) -> None:
    store = LateStore()
    world = make_world(store=store)
    check(world, "SET_MESSAGE_INTERVAL 54000 500000 : ACCEPTED\nlose 77 : -")
    store.delay = delay
    for each in (f"plan; {PAIR}", f"mission; {PAIR}", "COMPONENT_ARM_DISARM 1 to=autopilot"):
        ask(world, each)
    world.client.heartbeats = False
    world.run(0.2)
    world.server.engine.handle(PeerChanged(CLIENT_LINK, "client", up=False), now=world.now)
    world.run(0.1)
    received = len(world.client.received)
    world.run(4)
    assert len(world.client.received) == received
    assert len(world.tasks()) == (0 if delay == inf else 2)


def test_more_places_than_a_link_has_room_for(world: World) -> None:
    for number in range(300):
        change = PeerChanged(VEHICLE_LINK, f"peer {number}", up=True)
        world.server.engine.handle(change, now=world.now)
    world.fault(Faults(silent=True))
    world.run(5)
    beat = common.MAVLink_heartbeat_message(10, 3, 1, 0, 4, 3)
    for system in (1, 2):
        world.from_vehicle_side(beat.pack(common.MAVLink(None, system, 1)))
    world.run(1)
    known = world.server.engine.snapshot(now=world.now).vehicles
    assert [vehicle.system_id for vehicle in known] == [1]


def test_the_submissions_of_many_are_remembered_while_they_matter(world: World) -> None:
    world.client.pause()
    for number in range(300):
        packer = common.MAVLink(None, 1 + number % 200, 200 + number // 200)
        world.client.send_raw(command_long(54_000, 1.0).pack(packer))
        world.run(0.05)
    assert world.client.acks_of(54_000) == [(ACCEPTED, number) for number in range(1, 301)]


def test_no_rover_is_heard() -> None:
    world = World()
    world.fault(Faults(silent=True))
    check(world, "TASK_MOVE 1 to=any : FAILED #9")


def test_what_comes_from_a_link_that_is_not_there_is_not_heard(world: World) -> None:
    packet = world.client.packed(command_long(54_000, 1))
    for item in (
        Packets("nowhere", [("peer", packet)]),
        PeerChanged("nowhere", "peer", up=True),
        Congestion("nowhere", "peer", is_congested=True),
    ):
        world.server.engine.handle(item, now=world.now)
    assert not world.server.engine.has_heard("nowhere", "peer")
    assert world.tasks() == ()
