"""How one make speaks the mission protocol: numbers, and choices that the guide leaves open."""

from collections.abc import Mapping
from dataclasses import dataclass

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.enums import MavFrame, MavMissionResult

MISSION, FENCE, RALLY, ALL = 0, 1, 2, 255  # MAV_MISSION_TYPE


@dataclass(frozen=True, slots=True)
class MissionConventions:
    """One make's handling of missions, fences and rally points."""

    request: type[messages.MissionRequest | messages.MissionRequestInt]  # requests items with this
    capacity: int  # items of one list
    request_interval: float  # s between repeats of an unanswered request
    upload_timeout: float  # s without an item
    timeout_text: str
    timeout_result: MavMissionResult | None  # the ack that ends an upload; None: silence
    full_text: str | None
    busy: MavMissionResult  # to another client during an upload
    unknown_type: MavMissionResult
    wrong_sequence: MavMissionResult | None  # to an unrequested item; None: silence
    storable: Mapping[int, frozenset[int]]  # MAV_CMDs, by mission type
    stored_frames: Mapping[int, int]  # frames that are stored as others
    home_is_item_0: bool  # an uploaded item 0 is replaced by home, and not driven to
    has_ids: bool  # opaque ids in MISSION_ACK, MISSION_COUNT and MISSION_CURRENT
    goes_on: bool  # AUTO resumes the mission instead of restarting it
    takes_guided_items: bool  # a lone item with current = 2 is a place to drive to now, in GUIDED


NAVIGATION = frozenset({16, 17, 18, 19, 20, 42, 82, 83, 92, 93, 94, 112, 113, 114, 115})
DO = frozenset(range(177, 220))
AIRBORNE = frozenset({21, 22, 31, 84, 85})  # stored; a rover skips them
PAYLOAD = frozenset({530, 531, 532, 1000, 1001, 2000, 2001, 2500, 2501})  # likewise
FENCES = frozenset(range(5000, 5005))
RALLIES = frozenset({5100})

#: Rover 4.6.3: it requests with MISSION_REQUEST, never with the INT form, accepts MISSION_ITEM_INT
#: in answer, and has no opaque ids
ARDUPILOT_MISSIONS = MissionConventions(
    request=messages.MissionRequest,
    capacity=655,
    request_interval=1.0,
    upload_timeout=8.0,
    timeout_text="Mission upload timeout",
    timeout_result=MavMissionResult.OPERATION_CANCELLED,
    full_text="Only 655 items are supported",
    busy=MavMissionResult.DENIED,
    unknown_type=MavMissionResult.UNSUPPORTED,
    wrong_sequence=MavMissionResult.INVALID_SEQUENCE,
    storable={MISSION: NAVIGATION | DO, FENCE: FENCES, RALLY: RALLIES},
    stored_frames={  # INT frames come back as their plain forms
        MavFrame.GLOBAL_INT: MavFrame.GLOBAL,
        MavFrame.GLOBAL_RELATIVE_ALT_INT: MavFrame.GLOBAL_RELATIVE_ALT,
    },
    home_is_item_0=True,
    has_ids=False,
    goes_on=False,
    takes_guided_items=True,
)

#: PX4 1.15: an opaque id for each list; it ignores items that it did not request
PX4_MISSIONS = MissionConventions(
    request=messages.MissionRequestInt,
    capacity=2000,
    request_interval=0.25,
    upload_timeout=5.0,
    timeout_text="Operation timeout",
    timeout_result=None,
    full_text=None,
    busy=MavMissionResult.ERROR,
    unknown_type=MavMissionResult.INVALID,
    wrong_sequence=None,
    storable={MISSION: NAVIGATION | AIRBORNE | DO | PAYLOAD, FENCE: FENCES, RALLY: RALLIES},
    stored_frames={},
    home_is_item_0=False,
    has_ids=True,
    goes_on=True,
    takes_guided_items=False,
)
