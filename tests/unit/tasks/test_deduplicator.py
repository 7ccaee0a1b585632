"""The same task twice? The rules and their times."""

from dataclasses import replace

import pytest

from mav_tasks.errors import Rejection
from mav_tasks.tasks.deduplicator import (
    CONFIRMED,
    MANY_CLIENTS,
    NONCE_KEPT,
    SAME_GOAL,
    SAME_PACKET,
    SAME_PAYLOAD,
    Known,
    Rule,
    SubmissionDeduplicator,
)
from mav_tasks.tasks.goal import GlobalPlace, Goal, GoTo, LocalPlace, Move
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import ANY, Draft, Marks, Submitter, Task
from tests.unit.tasks.samples import SOMEBODY

EPSILON = 1e-6
ORIGIN = GlobalPlace(-353_632_620, 1_491_652_370)
NO_PACKETS = ""


class Rig:
    """A memory, and the tasks that it is about."""

    def __init__(self) -> None:
        self.registry = TaskRegistry()
        self.memory = SubmissionDeduplicator(self.registry)

    def draft(
        self,
        payload: str = "a",
        *,
        nonce: int = 0,
        packet: str = NO_PACKETS,
        command: int = 54000,
        goal: Goal | None = None,
        submitter: Submitter = SOMEBODY,
        vehicle: int = 1,
    ) -> Draft:
        marks = Marks(nonce, payload, packet)
        return Draft(vehicle, command, goal or Move(1.0), submitter, marks=marks)

    def known(self, draft: Draft, *, now: float, confirmation: int = 0) -> Known | None:
        return self.memory.known(draft, confirmation=confirmation, origin=ORIGIN, now=now)

    def submit(self, draft: Draft, *, now: float = 0.0) -> Task:
        """Submit something that is new."""
        assert self.known(draft, now=now) is None
        task = self.registry.submit(draft, now=now)
        self.memory.remember(task, at=now, now=now)
        return task


class TestThePacket:
    def test_again_is_the_same_for_a_while(self) -> None:
        rig = Rig()
        task = rig.submit(rig.draft("a", packet="p"))
        again = rig.draft("a", packet="p")
        assert rig.known(again, now=SAME_PACKET) == Known(task.id, Rule.SAME_PACKET)
        assert rig.known(again, now=SAME_PACKET + EPSILON) is None

    def test_is_known_after_others_of_the_same_command(self) -> None:
        rig = Rig()
        task = rig.submit(rig.draft("a", packet="p"))
        rig.submit(rig.draft("b", packet="q"))
        assert rig.known(rig.draft("a", packet="p"), now=1.0) == Known(task.id, Rule.SAME_PACKET)


class TestANonce:
    def test_counts_for_a_while_after_the_end_of_its_task(self) -> None:
        rig = Rig()
        task = rig.submit(rig.draft("a", nonce=7))
        rig.registry.change(task.id, S.CANCELLED, reason=TaskReason.CANCELLED, actor="", now=5000.0)
        again = rig.draft("a", nonce=7)
        assert rig.known(again, now=5000.0 + NONCE_KEPT) == Known(task.id, Rule.NONCE)
        assert rig.known(again, now=5000.0 + NONCE_KEPT + EPSILON) is None

    def test_makes_equal_payloads_one_as_long_as_the_task_is_not_over(self) -> None:
        rig = Rig()
        task = rig.submit(rig.draft("a", nonce=7))
        assert rig.known(rig.draft("a", nonce=7), now=1e6) == Known(task.id, Rule.NONCE)
        rig.registry.withdraw(task.id, now=1.0)
        assert rig.known(rig.draft("b", nonce=7), now=1e6) is None

    def test_must_not_come_with_another_payload(self) -> None:
        rig = Rig()
        rig.submit(rig.draft("a", nonce=7))
        with pytest.raises(Rejection) as refusal:
            rig.known(rig.draft("b", nonce=7), now=1.0)
        assert refusal.value.reason == TaskReason.NONCE_REUSED

    def test_makes_two_of_equal_payloads_if_it_differs(self) -> None:
        rig = Rig()
        assert rig.submit(rig.draft("a", nonce=1)) != rig.submit(rig.draft("a", nonce=2))

    def test_is_the_clients_from_whatever_endpoint(self) -> None:
        rig = Rig()
        task = rig.submit(rig.draft("a", nonce=7))
        moved = replace(SOMEBODY, endpoint="127.0.0.1:50999")
        assert rig.known(rig.draft("a", nonce=7, submitter=moved), now=9.0) == Known(
            task.id, Rule.NONCE
        )
        other = replace(SOMEBODY, component_id=191)
        assert rig.known(rig.draft("a", nonce=7, submitter=other), now=9.0) is None


class TestWithoutANonce:
    def test_a_confirmation_makes_it_a_repeat_for_ten_seconds(self) -> None:
        rig = Rig()
        task = rig.submit(rig.draft("a"))
        again = rig.draft("a")
        known = rig.known(again, now=CONFIRMED, confirmation=1)
        assert known == Known(task.id, Rule.CONFIRMED)
        assert rig.known(again, now=CONFIRMED + EPSILON, confirmation=1) is None
        assert rig.known(rig.draft("b"), now=0.1, confirmation=1) is None

    def test_an_equal_payload_is_the_same_for_a_while_after_each_copy(self) -> None:
        rig = Rig()
        task = rig.submit(rig.draft("a"))
        for now in (0.5, 1.0, 1.5, 1.5 + SAME_PAYLOAD):
            assert rig.known(rig.draft("a"), now=now) == Known(task.id, Rule.SAME_PAYLOAD)
        assert rig.known(rig.draft("a"), now=1.5 + 2 * SAME_PAYLOAD + EPSILON) is None

    def test_a_b_a_is_three_if_b_is_of_the_same_command_and_two_if_not(self) -> None:
        rig = Rig()
        rig.submit(rig.draft("a"))
        rig.submit(rig.draft("b"), now=0.1)
        third = rig.submit(rig.draft("a"), now=0.2)
        rig.submit(rig.draft("c", command=54001), now=0.3)
        assert rig.known(rig.draft("a"), now=0.4) == Known(third.id, Rule.SAME_PAYLOAD)

    def test_another_endpoint_is_another_client(self) -> None:
        rig = Rig()
        rig.submit(rig.draft("a"))
        rig.submit(rig.draft("a", submitter=replace(SOMEBODY, endpoint="127.0.0.1:1")), now=0.1)

    def test_what_was_refused_in_the_end_may_be_tried_again(self) -> None:
        rig = Rig()
        task = rig.submit(rig.draft("a", packet="p"))
        rig.memory.forget(task)
        rig.submit(rig.draft("a", packet="p"), now=0.1)


PLACE = GoTo(GlobalPlace(-353_632_000, 1_491_652_370))
NEARBY = GoTo(GlobalPlace(-353_631_930, 1_491_652_370))  # 0.8 m
FAR = GoTo(GlobalPlace(-353_631_800, 1_491_652_370))  # 2.2 m
LOCAL = GoTo(LocalPlace(6.9018, 0.0))  # the first, in the local frame


class TestAPlace:
    @pytest.mark.parametrize("goal", [PLACE, NEARBY, LOCAL])
    def test_within_a_metre_is_the_same_whatever_names_it(self, goal: GoTo) -> None:
        rig = Rig()
        task = rig.submit(rig.draft("a", command=192, goal=PLACE))
        again = rig.draft("b", command=16, goal=goal)
        assert rig.known(again, now=SAME_GOAL) == Known(task.id, Rule.SAME_GOAL)
        later = rig.draft("c", command=16, goal=goal)
        assert rig.known(later, now=SAME_GOAL + EPSILON) is None

    def test_what_was_the_same_goal_may_be_repeated_as_any_other(self) -> None:
        rig = Rig()
        task = rig.submit(rig.draft("a", command=16, goal=PLACE))
        again = rig.draft("b", command=192, goal=PLACE)
        rules = [rig.known(again, now=at) for at in (4.0, 4.5, 5.0, 5.5)]
        assert rules == [Known(task.id, Rule.SAME_GOAL)] + 3 * [Known(task.id, Rule.SAME_PAYLOAD)]

    def test_farther_off_is_another(self) -> None:
        rig = Rig()
        rig.submit(rig.draft("a", goal=PLACE))
        rig.submit(rig.draft("b", goal=FAR), now=1.0)

    def test_is_another_again_when_one_came_in_between(self) -> None:
        rig = Rig()
        rig.submit(rig.draft("a", goal=PLACE, command=192))
        rig.submit(rig.draft("b", goal=FAR, command=192), now=1.0)
        rig.submit(rig.draft("a", goal=PLACE, command=16), now=2.0)

    def test_home_is_home(self) -> None:
        rig = Rig()
        task = rig.submit(rig.draft("a", goal=GoTo(None), command=20))
        again = rig.draft("b", goal=GoTo(None), command=176)
        assert rig.known(again, now=1.0) == Known(task.id, Rule.SAME_GOAL)
        assert rig.known(rig.draft("c", goal=PLACE), now=1.0) is None

    def test_of_another_vehicle_is_another(self) -> None:
        rig = Rig()
        rig.submit(rig.draft("a", goal=PLACE))
        rig.submit(rig.draft("b", goal=PLACE, vehicle=2), now=0.1)

    def test_in_a_frame_without_an_origin_nothing_can_be_compared(self) -> None:
        rig = Rig()
        rig.submit(rig.draft("a", goal=PLACE, command=192))
        again = rig.draft("b", goal=LOCAL, command=16)
        assert rig.memory.known(again, confirmation=0, origin=None, now=1.0) is None


def test_after_a_restart_everything_is_known_as_before() -> None:
    rig = Rig()
    plain = rig.submit(rig.draft("a", packet="p"), now=100.0)
    marked = rig.submit(rig.draft("b", nonce=7), now=20.0)
    memory = SubmissionDeduplicator(rig.registry)
    memory.restore(rig.registry.all(), now=101.0)
    rig.memory = memory
    assert rig.known(rig.draft("a", packet="p"), now=101.0) == Known(plain.id, Rule.SAME_PACKET)
    assert rig.known(rig.draft("a"), now=102.0) == Known(plain.id, Rule.SAME_PAYLOAD)
    assert rig.known(rig.draft("b", nonce=7), now=1e6) == Known(marked.id, Rule.NONCE)


def test_a_submission_of_later_than_now_makes_copies_of_what_follows_no_longer_than_others() -> (
    None
):
    """The clock was set back since, or another gateway's was ahead."""
    rig = Rig()
    plain = rig.submit(rig.draft("a"), now=3_600.0)
    rig.memory = SubmissionDeduplicator(rig.registry)
    rig.memory.restore(rig.registry.all(), now=100.0)
    assert rig.known(rig.draft("a"), now=101.0) == Known(plain.id, Rule.SAME_PAYLOAD)
    assert rig.known(rig.draft("a"), now=110.0) is None


def test_clients_that_come_and_go_do_not_add_up() -> None:
    rig = Rig()
    for number in range(3 * MANY_CLIENTS):
        one = replace(SOMEBODY, endpoint=f"127.0.0.1:{number}")
        rig.submit(rig.draft("a", submitter=one), now=number * 1e-3)
    assert len(rig.memory._clients) <= MANY_CLIENTS


class TestAnyVehicle:
    """A submission to any vehicle, which the task's vehicle does not tell from a repeat."""

    def submitted(self, rig: Rig, *, nonce: int, now: float = 0.0) -> Task:
        draft = rig.draft(nonce=nonce, vehicle=ANY)
        assert rig.known(draft, now=now) is None
        task = rig.registry.submit(replace(draft, vehicle=2, choice="free"), now=now)
        rig.memory.remember(task, at=now, now=now)
        return task

    @pytest.mark.parametrize("nonce", [0, 5])
    def test_a_repeat_is_known_before_a_vehicle_is_chosen(self, nonce: int) -> None:
        rig = Rig()
        task = self.submitted(rig, nonce=nonce)
        known = rig.known(rig.draft(nonce=nonce, vehicle=ANY), now=1.0)
        assert known is not None
        assert known.task_id == task.id
        rig.memory.forget(task)
        assert rig.known(rig.draft(nonce=nonce, vehicle=ANY), now=1.0) is None

    def test_an_equal_command_to_a_named_vehicle_is_another_one(self) -> None:
        rig = Rig()
        self.submitted(rig, nonce=0)
        assert rig.known(rig.draft(vehicle=2), now=1.0) is None

    def test_it_is_forgotten_with_the_vehicle_that_has_it(self) -> None:
        rig = Rig()
        kept, gone = self.submitted(rig, nonce=5), self.submitted(rig, nonce=0)
        rig.memory.forget_vehicle(2, {gone.id})
        assert rig.known(rig.draft(vehicle=ANY), now=1.0) is None
        known = rig.known(rig.draft(nonce=5, vehicle=ANY), now=1.0)
        assert known is not None
        assert known.task_id == kept.id
