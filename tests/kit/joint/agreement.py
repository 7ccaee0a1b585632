"""Checks that the server agrees with the model of joint control, at each event.

``graph`` explores the states of the model, which proves something about the server only if both
agree.
"""

from functools import cache
from typing import Any

import pytest

from mav_tasks.engine.vehicles.control import Event
from mav_tasks.engine.vehicles.hands import Word
from mav_tasks.engine.vehicles.joint_control import JointControl
from mav_tasks.engine.vehicles.joint_state import State
from tests.kit.joint.model import FREE, happens

LEFT_OPEN: dict[str, Any] = dict.fromkeys(FREE, False)


class Agreement:
    """Checks every event of every vehicle, and records transitions that the model lacks."""

    def __init__(self) -> None:
        self.surprises: list[str] = []
        self.compared = 0
        self._is_within = False

    def look_on(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Start checking."""
        done = JointControl.on

        def on(joint: JointControl, event: Event, word: Word, *, now: float) -> Any:
            if self._is_within:
                return done(joint, event, word, now=now)
            joint.decide(now=now)  # an event of its own, which is compared, too
            self._is_within = True
            try:
                before = joint.state(now=now)
                result = done(joint, event, word, now=now)
                self._compare(event, before, joint.state(now=now))
            finally:
                self._is_within = False
            return result

        monkeypatch.setattr(JointControl, "on", on)

    def _compare(self, event: Event, before: State, there: State) -> None:
        self.compared += 1
        if _open(there) not in _expected(event, before):
            self.surprises.append(f"{event.name} in {before}: {there}")


@cache
def _expected(event: Event, before: State) -> frozenset[State]:
    return frozenset(map(_open, happens(event, before)))


def _open(state: State) -> State:
    return state._replace(**LEFT_OPEN)
