"""How one make speaks the mission protocol: numbers, and choices that the guide leaves open."""

from collections.abc import Mapping
from dataclasses import dataclass

from mav_tasks.mavlink.enums import MavMissionResult

MISSION, FENCE, RALLY, ALL = 0, 1, 2, 255  # MAV_MISSION_TYPE


@dataclass(frozen=True, slots=True)
class MissionConventions:
    """One make's handling of missions, fences and rally points."""

    requests_int: bool  # items with MISSION_REQUEST_INT, not with MISSION_REQUEST
    capacity: int  # items of one list
    request_interval: float  # s between repeats of an unanswered request
    upload_timeout: float  # s without an item
    timeout_text: str
    busy: MavMissionResult  # to another client during an upload
    unknown_type: MavMissionResult
    stores_airborne: bool  # takes commands of aircraft and payloads, which a rover skips
    stored_frames: Mapping[int, int]  # frames that are stored as others
    home_is_item_0: bool  # an uploaded item 0 is replaced by home, and not driven to
    has_ids: bool  # opaque ids in MISSION_ACK, MISSION_COUNT and MISSION_CURRENT
    goes_on: bool  # AUTO resumes the mission instead of restarting it
    takes_guided_items: bool  # a lone item with current = 2 is a place to drive to now, in GUIDED
    timeout_result: MavMissionResult | None = None  # the ack that ends an upload; None: silence
    full_text: str = ""
    wrong_sequence: MavMissionResult | None = None  # to an unrequested item; None: silence

    @property
    def storable(self) -> Mapping[int, frozenset[int]]:
        """The MAV_CMDs that can be stored, by mission type."""
        mission = NAVIGATION | DO | (AIRBORNE if self.stores_airborne else frozenset())
        return {MISSION: mission, FENCE: FENCES, RALLY: RALLIES}


NAVIGATION = frozenset({16, 17, 18, 19, 20, 42, 82, 83, 92, 93, 94, 112, 113, 114, 115})
DO = frozenset(range(177, 220))
AIRBORNE = frozenset({21, 22, 31, 84, 85, 530, 531, 532, 1000, 1001, 2000, 2001, 2500, 2501})
FENCES = frozenset(range(5000, 5005))
RALLIES = frozenset({5100})
