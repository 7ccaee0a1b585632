"""The observer that ends every scenario: it is content with good driving and catches each sin."""

from collections.abc import Callable

import pytest
from pymavlink.dialects.v20 import common

from tests.kit.cases import for_each
from tests.kit.client import (
    AUTO,
    GUIDED,
    HOLD,
    MANUAL,
    STOP,
    command_long,
    packed,
    setpoint,
)
from tests.kit.observer import Observer

ROVER, SERVER, CLIENT = (1, 1), (250, 191), (255, 190)


class Story:
    """What an observer sees, told by hand."""

    def __init__(self) -> None:
        self.observer = Observer()
        self.now = 10.0

    def later(self, seconds: float) -> "Story":
        self.now += seconds
        return self

    def rover(self, mode: int, *, armed: bool) -> "Story":
        beat = common.MAVLink_heartbeat_message(10, 3, 129 if armed else 1, mode, 4, 3)
        self.observer.heard(self.now, packed(beat, *ROVER), sent_at=self.now)
        return self

    def position(self, *, age: float = 0.0) -> "Story":
        sent_at = self.now - age
        place = common.MAVLink_local_position_ned_message(1, 0, 0, 0, 0, 0, 0)
        self.observer.heard(self.now, packed(place, *ROVER), sent_at=sent_at)
        heading = common.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0)
        self.observer.heard(self.now, packed(heading, *ROVER), sent_at=sent_at)
        return self

    def sends(self, message: object, source: tuple[int, int] = SERVER) -> "Story":
        self.observer.sent(self.now, packed(message, *source))
        self.observer.arrived(self.now, packed(message, *source))
        return self

    def moves(self, speed: float = 0.5) -> "Story":
        return self.sends(setpoint(speed))

    def asks(self, message: object) -> "Story":
        self.observer.asked(self.now, packed(message, *CLIENT), peer="client")
        return self

    def really_unready(self) -> "Story":
        self.observer.is_ready = lambda: False
        return self

    def in_batches(self) -> "Story":
        self.observer.batches = True
        return self

    def driving(self) -> "Story":
        """A rover that we have taken as we should, and that we drive."""
        self.rover(HOLD, armed=False).position()
        self.sends(mode_request(GUIDED)).later(0.01).rover(GUIDED, armed=False)
        self.moves(0.0).sends(arming(1)).later(0.01).rover(GUIDED, armed=True)
        for _ in range(5):
            self.later(0.05).position().moves()
        return self


def mode_request(mode: int) -> object:
    return command_long(176, 1, mode, target=(1, 1))


def arming(armed: int) -> object:
    return command_long(400, armed, target=(1, 1))


@for_each("mode, later", [(AUTO, 0.0), (HOLD, 0.01)])
def test_news_of_another_mode_or_of_another_step_is_a_takeover(mode: int, later: float) -> None:
    story = Story().driving().later(0.05).in_batches()
    story.asks(mode_request(HOLD)).later(later).rover(mode, armed=True)
    with pytest.raises(AssertionError, match="after a takeover"):
        story.moves(0.0).observer.check()


SINS: list[tuple[str, Callable[[Story], object]]] = [
    (
        "not seen armed",
        lambda s: s.rover(GUIDED, armed=False).position().moves(0.0).later(0.05).moves(),
    ),
    (
        "known not to be ready",
        lambda s: s.really_unready().rover(HOLD, armed=True).later(0.6).moves(),
    ),
    ("in mode 10", lambda s: s.rover(AUTO, armed=True).position().moves()),
    (
        "before a zero",
        lambda s: s.rover(GUIDED, armed=True).position().moves(),
    ),
    ("not finite", lambda s: s.driving().later(0.05).moves(float("nan"))),
    (
        "stale data",
        lambda s: [s.driving()] + [s.later(0.05).moves() for _ in range(7)],
    ),
    ("gap of .* while", lambda s: s.driving().later(0.2).position().moves()),
    (
        "burst",
        lambda s: [s.driving()] + [s.later(0.01).moves() for _ in range(6)],
    ),
    (
        "before a zero",
        lambda s: s.rover(GUIDED, armed=False).sends(arming(1)),
    ),
    (
        "taken from mode 0",
        lambda s: s.rover(MANUAL, armed=True).sends(mode_request(GUIDED)),
    ),
    (
        "after a takeover",
        lambda s: s.driving().later(0.01).rover(HOLD, armed=True).later(0.04).moves(0.0),
    ),
    (
        "arming after a takeover",
        lambda s: s.driving().rover(GUIDED, armed=False).later(0.05).sends(arming(1)),
    ),
    (
        "without HOLD",
        lambda s: s.driving().asks(command_long(STOP)).moves(0.0),
    ),
    (
        "without zero",
        lambda s: s.driving().asks(command_long(STOP)).sends(mode_request(HOLD)),
    ),
    (
        "two sources",
        lambda s: s.driving().later(0.5).sends(setpoint(1.0), CLIENT),
    ),
    (
        "while the server drives",
        lambda s: s.driving().later(0.01).sends(setpoint(1.0), CLIENT),
    ),
]


@for_each("words, tell", SINS)
def test_each_sin_is_caught(words: str, tell: Callable[[Story], object]) -> None:
    story = Story()
    tell(story)
    with pytest.raises(AssertionError, match=words):
        story.observer.check()


@for_each("message", [setpoint(1.0), mode_request(AUTO), arming(1)])
def test_whatever_moves_and_passes_after_a_stop_is_caught(message: object) -> None:
    story = Story().rover(HOLD, armed=True).asks(command_long(STOP))
    story.sends(mode_request(HOLD)).moves(0.0).later(0.5).sends(message, CLIENT)
    with pytest.raises(AssertionError, match="in spite of STOP"):
        story.observer.check()
