"""Submissions that wait until the fleet's store has said whether the task before them exists."""

import pytest

from mav_tasks.engine.commands import dependency_questions
from mav_tasks.engine.commands.dependency_questions import WITHIN, DependencyQuestions
from mav_tasks.engine.timers import Timers
from mav_tasks.errors import Rejection
from mav_tasks.settings import Settings
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.pending_tasks import PendingTasks
from mav_tasks.tasks.registry import TaskRegistry


class Rig:
    """Questions about tasks that no vehicle of this gateway has."""

    def __init__(self, *, is_shared: bool = True) -> None:
        self.room = PendingTasks(TaskRegistry(), Settings())
        if is_shared:
            self.room.share()
        self.timers = Timers()
        self.questions = DependencyQuestions(self.room, self.timers)
        self.went_on: list[tuple[str, float]] = []
        self.refused: list[tuple[str, int, float]] = []

    def ask(self, name: str, after: int, *, now: float) -> bool:
        def go_on(*, now: float) -> None:
            self.went_on.append((name, now))

        def refuse(refusal: Rejection, /, *, now: float) -> None:
            self.refused.append((name, refusal.reason, now))

        return self.questions.hold(after, go_on, refuse, now=now)

    def answer(self, states: dict[int, S | None], *, now: float) -> None:
        with self.room.told(states, now=now):
            self.questions.answered(now=now)

    def pass_to(self, now: float) -> None:
        for timer in self.timers.take_due(now=now):
            timer.do(now=now)


def test_an_answer_lets_those_go_on_that_it_is_about() -> None:
    rig = Rig()
    held = [rig.ask(name, after, now=1.0) for name, after in (("a", 7), ("b", 8), ("c", 7))]
    assert held == [True] * 3
    assert rig.questions.expected == {7, 8}
    rig.answer({7: None}, now=1.5)
    assert rig.went_on == [("a", 1.5), ("c", 1.5)]
    assert rig.questions.expected == {8}
    rig.answer({8: S.EXECUTING}, now=1.6)
    rig.pass_to(1.0 + WITHIN)
    assert (rig.went_on[2:], rig.refused, len(rig.questions)) == ([("b", 1.6)], [], 0)


def test_what_needs_no_answer_is_not_held() -> None:
    rig = Rig()
    assert not rig.ask("no dependency", 0, now=1.0)
    assert not Rig(is_shared=False).ask("no fleet", 7, now=1.0)


def test_without_an_answer_each_is_refused_at_its_time() -> None:
    rig = Rig()
    rig.ask("a", 7, now=1.0)
    rig.ask("b", 7, now=1.4)
    rig.pass_to(1.0 + WITHIN)
    assert rig.refused == [("a", R.STORE_UNAVAILABLE, 1.0 + WITHIN)]
    rig.pass_to(1.4 + WITHIN)
    assert [name for name, _, _ in rig.refused] == ["a", "b"]
    assert rig.went_on == []


def test_when_a_key_is_revoked_all_must_be_sent_again() -> None:
    rig = Rig()
    rig.ask("a", 7, now=1.0)
    rig.questions.keys_revoked(now=1.1)
    rig.answer({7: S.EXECUTING}, now=1.2)
    rig.pass_to(1.0 + WITHIN)
    assert (rig.refused, rig.went_on) == ([("a", R.STALE, 1.1)], [])


def test_they_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dependency_questions, "MOST", 1)
    rig = Rig()
    rig.ask("a", 7, now=1.0)
    with pytest.raises(Rejection) as refused:
        rig.ask("b", 8, now=1.0)
    assert refused.value.reason == R.RATE_LIMITED
