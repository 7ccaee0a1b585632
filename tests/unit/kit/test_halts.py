"""The rule of halts can fail, and is not broken by a rover that somebody let go."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import pytest

from rover_sim.body import BodyState, Pose
from rover_sim.faults import Faults
from rover_sim.kinematic import KinematicBody
from rover_sim.personas import Mode
from rover_sim.vehicle import Vehicle
from tests.kit.halts import STOPS_WITHIN, Halts
from tests.kit.words import Kind, Word

STEP = 0.025  # s
ACCEPTED, DENIED = 0, 2
STANDING = KinematicBody(start=Pose(), slip=0.0, seed=None).state
COMMANDS = {"STOP": 54003, "pause": 193, "continue": 193, "HOLD": 176, "release": 54013}


class Watched:
    """A rover that a test moves, and what its server reads and answers."""

    def __init__(self) -> None:
        autopilot = SimpleNamespace(mode=Mode.GUIDED, faults=Faults(), armed=True)
        self.vehicle = SimpleNamespace(autopilot=autopilot, truth=STANDING)
        self.halts = Halts(cast(Vehicle, self.vehicle), 1)
        self.now = 100.0
        self._order = 0

    def say(
        self,
        name: str,
        *,
        by: str = "station",
        first: float | None = None,
        order: int | None = None,
        is_copy: bool = False,
        result: int = ACCEPTED,
    ) -> None:
        """Let the server read a word, and answer it at once."""
        self._order += 1
        kind = Kind.HALT if name in ("STOP", "pause", "HOLD") else Kind.GO
        sent = self.now if first is None else first
        place = self._order if order is None else order
        command = COMMANDS[name]
        param1 = 1.0 if name == "continue" else 0.0
        word = Word(kind, name, command, 1, param1, by, sent, place, is_copy)
        self.halts.read(word, running=None, now=self.now)
        self.halts.answered(by, command, result, now=self.now)

    def drive(self, seconds: float, speed: float = 0.5) -> list[str]:
        """Let the rover drive; gives the breaches."""
        found: list[str] = []
        for _ in range(round(seconds / STEP)):
            self.now += STEP
            self.vehicle.truth = self._state(self.vehicle.truth.north + speed * STEP, speed)
            found += [broken.kind for broken in self.halts.look(self.now)]
        return found

    def stand(self, seconds: float) -> list[str]:
        """Let the rover stand."""
        return self.drive(seconds, 0.0)

    @staticmethod
    def _state(north: float, speed: float) -> BodyState:
        return replace(STANDING, north=north, forward_speed=speed)


@pytest.fixture
def watched() -> Watched:
    return Watched()


def test_nobody_halts_and_nothing_is_wrong(watched: Watched) -> None:
    assert watched.drive(10) == []


def test_a_rover_that_stops_and_stands_breaks_nothing(watched: Watched) -> None:
    watched.drive(1)
    watched.say("STOP")
    assert watched.drive(1.0, 0.25) == []
    assert watched.stand(10) == []
    assert watched.halts.halted == {"STOP": 1}


def test_one_that_drives_on_is_seen(watched: Watched) -> None:
    watched.drive(1)
    watched.say("pause")
    assert watched.drive(5) == ["pause, then no word"]


def test_one_that_stood_and_drives_again_is_seen_after_centimetres(watched: Watched) -> None:
    watched.say("HOLD")
    watched.stand(STOPS_WITHIN + 1)
    assert watched.drive(0.15) == []
    assert watched.drive(0.15) == ["HOLD, then no word"]


def test_a_copy_of_an_older_continue_is_no_excuse(watched: Watched) -> None:
    watched.say("continue")
    watched.now += 1
    watched.say("STOP")
    watched.stand(3)
    watched.say("continue", first=100.0, order=1, is_copy=True)
    assert watched.drive(2) == ["STOP, then a copy of an older continue that was late"]


def test_an_older_word_of_the_same_sender_that_comes_later_is_none_either(watched: Watched) -> None:
    watched.say("STOP", order=12)
    watched.say("continue", order=11)
    watched.stand(3)
    assert watched.drive(2) == ["STOP, then an older continue"]


@pytest.mark.parametrize("by", ["station", "tablet"])
def test_a_newer_go_word_ends_it(watched: Watched, by: str) -> None:
    watched.say("STOP")
    watched.stand(3)
    watched.say("continue", by=by)
    assert watched.drive(5) == []


def test_hold_and_continue_said_together_are_a_go(watched: Watched) -> None:
    """As somebody does who makes the rover ready: neither waits for an answer."""
    hold = Word(Kind.HALT, "HOLD", 176, 1, 1.0, "station", 100.0, 1, is_copy=False)
    go = Word(Kind.GO, "continue", 193, 1, 1.0, "station", 100.0, 2, is_copy=False)
    for word in (hold, go):
        watched.halts.read(word, running=None, now=100.02)
    watched.halts.answered("station", 176, ACCEPTED, now=100.02)
    watched.halts.answered("station", 193, ACCEPTED, now=100.02)
    assert watched.drive(5) == []


def test_what_is_refused_lets_nothing_go(watched: Watched) -> None:
    watched.say("STOP")
    watched.stand(3)
    watched.say("continue", result=DENIED)
    assert watched.drive(1) == ["STOP, then no word"]
    assert watched.halts.refused == {"continue": 1}


def test_what_reached_the_rover_lets_it_go_though_its_answer_is_lost(watched: Watched) -> None:
    watched.say("pause")
    watched.stand(3)
    watched.halts.passed(COMMANDS["continue"], now=watched.now)
    watched.say("continue", result=DENIED)
    assert watched.drive(1) == []
    assert watched.halts.refused == {}


def test_what_reached_the_rover_before_the_halt_does_not(watched: Watched) -> None:
    watched.halts.passed(COMMANDS["continue"], now=watched.now)
    watched.stand(1)
    watched.say("pause")
    watched.stand(3)
    watched.say("continue", result=DENIED)
    assert watched.drive(1) == ["pause, then no word"]


@pytest.mark.parametrize("sent", [0.0, -0.05])
def test_what_is_submitted_after_a_hold_of_nothing_drives(watched: Watched, sent: float) -> None:
    """Also while a word of a third is not answered yet, and if the two pass on their way."""
    hold = Word(Kind.HALT, "HOLD", 176, 1, 1.0, "station", watched.now, 1, is_copy=False)
    watched.halts.read(hold, running=None, now=watched.now, has_tasks=False)
    watched.halts.answered("station", 176, ACCEPTED, now=watched.now)
    read_at, first_sent = watched.now + 0.02, watched.now + 0.01 + sent
    start = Word(Kind.GO, "mission start", 300, 1, 0.0, "third", first_sent, 2, is_copy=False)
    move = Word(Kind.WISH, "submission", 54000, 1, 1.0, "other", first_sent, 3, is_copy=False)
    watched.halts.read(start, running=None, now=read_at)
    watched.halts.read(move, running=None, now=read_at)
    watched.halts.answered("third", 300, DENIED, now=read_at)
    assert watched.drive(5) == []


def test_after_stop_only_a_continue_lets_it_go(watched: Watched) -> None:
    watched.say("STOP")
    watched.stand(3)
    watched.say("release")
    assert watched.drive(1) == ["STOP, then no word"]


def test_two_people_whose_words_pass_each_other_are_counted_and_nobody_is_wrong(
    watched: Watched,
) -> None:
    watched.say("pause")
    watched.say("continue", by="tablet", first=watched.now - 0.05)
    assert watched.drive(5) == []
    assert watched.halts.in_flight == 1


def test_a_person_at_the_rover_halts_it_too(watched: Watched) -> None:
    watched.halts.person("HOLD at the rover", drives=False, now=watched.now)
    watched.stand(3)
    assert watched.drive(1) == ["HOLD at the rover, then no word"]


def test_a_rover_that_hears_nothing_is_not_judged(watched: Watched) -> None:
    watched.vehicle.autopilot.faults = Faults(deaf=True)
    watched.say("STOP")
    assert watched.drive(5) == []


def test_a_rover_that_drives_by_itself_is_not_judged(watched: Watched) -> None:
    watched.say("HOLD")
    watched.stand(3)
    watched.vehicle.autopilot.mode = Mode.RTL  # its own failsafe
    assert watched.drive(3) == []


def test_a_mode_that_the_server_asked_for_is_judged(watched: Watched) -> None:
    watched.say("HOLD")
    watched.stand(3)
    watched.halts.mode_arrived(now=watched.now)
    watched.vehicle.autopilot.mode = Mode.AUTO
    assert watched.drive(3) == ["HOLD, then no word"]
