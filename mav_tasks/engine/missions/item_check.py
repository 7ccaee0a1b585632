"""Checks each item of an upload as it comes, and makes the plan of all of them.

An upload is refused at the first bad item, so that its client learns which one it is.
"""

from mav_tasks.engine.commands.ability import Ability
from mav_tasks.engine.commands.assignments import check_any
from mav_tasks.engine.commands.goals import bad
from mav_tasks.engine.missions.fence_items import check_fence_item, check_rally_item
from mav_tasks.engine.missions.plan_items import (
    ParsedMission,
    plan_of,
    result_of,
    step_of,
)
from mav_tasks.engine.missions.plan_table import MissionParseOptions
from mav_tasks.engine.missions.plans import STORED
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.errors import Rejection
from mav_tasks.mavlink.address import AUTOPILOT
from mav_tasks.mavlink.enums import MavMissionResult, MavMissionType
from mav_tasks.services.mission_item import Item
from mav_tasks.settings import Settings
from mav_tasks.tasks.goal import GoTo, Step, number_of
from mav_tasks.tasks.lifecycle import TaskReason

R = TaskReason


class PlanCheck:
    """The item check of uploads to one address, one upload after the other."""

    def __init__(self) -> None:
        self._read_by: tuple[int, MissionParseOptions] | None = (
            None  # item count and options of ``_read``
        )
        self._read: list[tuple[Item, Step]] = []  # each item is parsed once: it takes time
        self._refusal: Rejection | None = None

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self._read)} items read)"

    def take_refusal(self) -> Rejection | None:
        """Return why an item was refused since the last call, or None."""
        refusal, self._refusal = self._refusal, None
        return refusal

    def __call__(self, kind: int, seq: int, item: Item, count: int) -> MavMissionResult | None:
        """Return None if an item may be part of a plan, else the result. Call in order of items."""
        if kind not in STORED:
            return MavMissionResult.UNSUPPORTED
        try:
            if kind == MavMissionType.FENCE:
                check_fence_item(item, seq, count=count)
            elif kind == MavMissionType.RALLY:
                check_rally_item(item, seq)
            else:
                step = self._step(item, seq, count=count)
                if isinstance(step, GoTo):
                    self._check_place(step, seq)
        except Rejection as refusal:
            self._refusal = refusal
            return result_of(refusal)
        return None

    def plan_of(self, items: tuple[Item, ...], *, now: float) -> ParsedMission:
        """Return the plan of a whole upload. Raise Rejection if it makes none."""
        steps = tuple(self._step(item, seq, count=len(items)) for seq, item in enumerate(items))
        return plan_of(items, steps, has_home=self._manner.has_home, now=now)

    @property
    def _manner(self) -> MissionParseOptions:
        """How the items are parsed."""
        raise NotImplementedError

    def _check_place(self, step: GoTo, seq: int) -> None:
        """Raise Rejection for a place that may not be part of a plan."""
        raise NotImplementedError

    def _step(self, item: Item, seq: int, *, count: int) -> Step:
        manner = self._manner
        if (count, manner) != self._read_by:  # in the middle of an upload: parse all items again
            self._read_by = count, manner
            self._read.clear()
        read = self._read
        if seq < len(read) and read[seq][0] is item:
            return read[seq][1]
        step = step_of(item, seq, count=count, manner=manner)
        if seq <= len(read):
            read[seq:] = [(item, step)]
        return step


class AnyCheck(PlanCheck):
    """The item check of plans for any rover."""

    def __init__(self, settings: Settings) -> None:
        super().__init__()
        self.settings = settings

    @property
    def _manner(self) -> MissionParseOptions:
        return MissionParseOptions(has_home=False, ability=Ability(), driving=self.settings.driving)

    def _check_place(self, step: GoTo, seq: int) -> None:
        try:
            check_any(step)
        except Rejection as refusal:
            raise Rejection(refusal.reason, f"item {seq + 1}: {refusal.text}") from None


class ItemCheck(PlanCheck):
    """The item check of uploads for one vehicle."""

    def __init__(self, vehicle: Vehicle, component: int) -> None:
        super().__init__()
        self._vehicle = vehicle
        self._is_at_autopilot = component == AUTOPILOT

    def plan_of(self, items: tuple[Item, ...], *, now: float) -> ParsedMission:
        """Return the plan of a whole upload. Raise Rejection if it makes none."""
        wanted = super().plan_of(items, now=now)
        forbidden = self._vehicle.where.leg_over_fence(wanted.plan.steps)
        if forbidden is not None:
            words = f"item {wanted.plan.item_number(forbidden)}: a jump to it crosses the fence"
            raise Rejection(R.OUTSIDE_FENCE, words)
        return wanted

    @property
    def _manner(self) -> MissionParseOptions:
        persona, driving = self._vehicle.persona, self._vehicle.parts.settings.driving
        return MissionParseOptions.of(persona, is_staged=self._is_at_autopilot, driving=driving)

    def _check_place(self, step: GoTo, seq: int) -> None:
        """Raise Rejection for a place too far away, outside the fence, or reached across it."""
        name = f"item {number_of(seq, has_home=self._manner.has_home)}"
        longest = self._vehicle.parts.settings.driving.max_distance
        far = self._vehicle.where.distance_to(step)
        if far is not None and far > longest:
            words = f"{name} is {far / 1000:.1f} km away, more than {longest / 1000:g} km"
            raise bad(words, param=5)
        if not self._vehicle.where.is_within_fence(step):
            raise Rejection(R.OUTSIDE_FENCE, f"{name} is outside the fence")
        steps: list[Step] = [step]
        for number in range(min(seq, len(self._read)) - 1, -1, -1):  # back to the last place
            steps.insert(0, self._read[number][1])
            if isinstance(steps[0], GoTo):
                break
        if self._vehicle.where.leg_over_fence(steps) is not None:
            raise Rejection(R.OUTSIDE_FENCE, f"{name}: the path to it crosses the fence")
