"""The rule of halts can fail, and is not broken by a rover that somebody let go."""

from types import SimpleNamespace
from typing import cast

from rover_sim.body import BodyState, Pose
from rover_sim.faults import Faults
from rover_sim.kinematic import KinematicBody
from rover_sim.personas import Mode
from rover_sim.vehicle import Vehicle
from tests.kit.halts import Halts
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

    @staticmethod
    def _state(north: float, speed: float) -> BodyState:
        return STANDING._replace(north=north, forward_speed=speed)


SCRIPTS = {
    # nobody halts, or it stops and stands
    "d10": "",
    "d1 STOP slow1 s10": "",
    # it drives on, or again
    "d1 pause d5": "pause, then no word",
    "HOLD s4 d0.15": "",
    "HOLD s4 d0.3": "HOLD, then no word",
    # an older word is no excuse
    "continue s1 STOP s3 late d2": "STOP, then a copy of an older continue that was late",
    "STOP:12 continue:11 s3 d2": "STOP, then an older continue",
    # a newer go word ends it
    "STOP s3 continue d5": "",
    "STOP s3 continue@tablet d5": "",
    "STOP s3 release d1": "STOP, then no word",
    # what is refused lets nothing go, unless it reached the rover
    "STOP s3 continue! d1": "STOP, then no word",
    "pause s3 passed continue! d1": "",
    "passed s1 pause s3 continue! d1": "pause, then no word",
    # a person at the rover halts it too
    "person s3 d1": "HOLD at the rover, then no word",
    # who hears nothing or drives by itself is not judged, but by a mode that was asked for
    "deaf STOP d5": "",
    "HOLD s3 rtl d3": "",
    "HOLD s3 asked d3": "HOLD, then no word",
}


def told(watched: Watched, script: str) -> list[str]:
    """Let a script happen: words, and driving (d) or standing (s) for seconds."""
    found: list[str] = []
    autopilot = watched.vehicle.autopilot
    for step in script.split():
        if step[0] in "ds" and step[1:].replace(".", "").isdigit():
            found += watched.drive(float(step[1:]), 0.5 if step[0] == "d" else 0.0)
        elif step == "slow1":
            found += watched.drive(1.0, 0.25)
        elif step == "late":
            watched.say("continue", first=100.0, order=1, is_copy=True)
        elif step == "passed":
            watched.halts.passed(COMMANDS["continue"], now=watched.now)
        elif step == "person":
            watched.halts.person("HOLD at the rover", drives=False, now=watched.now)
        elif step == "deaf":
            autopilot.faults = Faults(deaf=True)
        elif step == "rtl":
            autopilot.mode = Mode.RTL
        elif step == "asked":
            watched.halts.mode_arrived(now=watched.now)
            autopilot.mode = Mode.AUTO
        else:
            name, _, by = step.rstrip("!").partition("@")
            name, _, order = name.partition(":")
            watched.say(
                name,
                by=by or "station",
                order=int(order) if order else None,
                result=DENIED if "!" in step else ACCEPTED,
            )
    return found


def test_a_rover_that_drives_after_a_halt_is_seen_and_no_other() -> None:
    for script, breach in SCRIPTS.items():
        assert told(Watched(), script) == [breach] * bool(breach), script
