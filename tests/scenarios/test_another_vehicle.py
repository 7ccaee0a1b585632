"""Another autopilot at a known address is another vehicle, whatever the first one was doing."""

from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import common

from mav_tasks.links.memory import Conditions
from mav_tasks.shell.in_memory import VEHICLE_LINK
from mav_tasks.tasks.events import VehicleNoted
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Mode, Persona
from tests.kit.cases import for_each
from tests.kit.client import ARM, FAILED, SET_MODE
from tests.kit.px4 import PROMPT_PX4
from tests.kit.rows import ask, check
from tests.kit.volume import some
from tests.kit.world import MODE_COMMAND, PROMPT, SETPOINT, World, ways_of
from tests.scenarios.conftest import MakeWorld

PERSONAS = {"ardupilot": PROMPT, "px4": PROMPT_PX4}
#: (param2, param3) that mean HOLD to each
HOLDS = {"ardupilot": {(4.0, 0.0), (4.0, 3.0)}, "px4": {(4.0, 3.0)}}
DIRECTIONS = [("ardupilot", "px4"), ("px4", "ardupilot")]
COPTER = 2  # MAV_TYPE_QUADROTOR
ROVER, ARDUPILOT, PX4 = 10, 3, 12
DELAY = Conditions().delay
LOITER = 17  # MAV_CMD_NAV_LOITER_UNLIM

directions = for_each("old, new", DIRECTIONS)


class Swapped:
    """A world in which another rover answers at the first one's address, and what it is sent."""

    def __init__(
        self,
        world: World,
        persona: Persona,
        *,
        mode: Mode = Mode.HOLD,
        at_first_beat: Callable[[], object] = lambda: None,
    ) -> None:
        """Put an armed rover there; it stands, and would drive if it were asked for a mission.

        ``at_first_beat`` is called so that the server reads what it sends in the turn in which it
        reads the new rover's first heartbeat.
        """
        self.world = world
        self.persona = persona
        self._at_first_beat = at_first_beat
        self.met_at: float | None = None  # when the server reads that heartbeat
        self.got: list[Any] = []  # since then
        self._decoder = common.MAVLink(None)
        self.rover = world.replace_rover(switched_on=world.now - 60.0, persona=persona)
        self.rover.handle_deadline(now=world.now)  # a mode is lost in the boot, which is over
        self.rover.autopilot.operator_arm(True, now=world.now)
        self.rover.autopilot.operator_mode(mode, now=world.now)
        self.start = self.place()
        self.modes: set[Mode] = set()
        world.watch(lambda _now: self.modes.add(self.rover.autopilot.mode))
        world.watched.loses = self._look_at_sent
        world.watched.on_arrival = self._look_at_arrived

    def place(self) -> tuple[float, float]:
        truth = self.rover.truth
        return round(truth.north, 3), round(truth.east, 3)

    def _look_at_sent(self, source: str, target: str, data: bytes) -> bool:
        is_beat = (source, target) == ("rover1", VEHICLE_LINK) and data[7] == 0
        if is_beat and self.met_at is None:
            self.met_at = self.world.now + DELAY
            self.world.observer.meets(ways_of(self.persona))
            self._at_first_beat()
        return False

    def _look_at_arrived(self, name: str, _source: str, data: bytes) -> None:
        is_since = self.met_at is not None and self.world.now >= self.met_at + DELAY
        if is_since and name == "rover1" and data[7] in (MODE_COMMAND, SETPOINT):
            self.got.append(self._decoder.decode(bytearray(data)))

    def asked_modes(self) -> set[tuple[float, float]]:
        """Return (param2, param3) of each DO_SET_MODE that has arrived."""
        return {
            (message.param2, message.param3)
            for message in self.got
            if message.get_msgId() == MODE_COMMAND and message.command == SET_MODE
        }

    def armings(self) -> list[float]:
        return [m.param1 for m in self.got if m.get_msgId() == MODE_COMMAND and m.command == ARM]

    def check_untouched(self) -> None:
        """Assert that nothing has driven it, and that it was asked for nothing but HOLD."""
        assert self.asked_modes() <= HOLDS[self.persona.name]
        assert self.modes <= {Mode.HOLD, Mode.MANUAL}
        assert self.place() == self.start
        assert 1.0 not in self.armings()
        moving = [m for m in self.got if m.get_msgId() == SETPOINT and abs(m.vx) + abs(m.vy) > 0.01]
        assert moving == []


RUNNING = """TASK_MOVE 9 & until 1 EXECUTING : ACCEPTED
TASK_MOVE 8 & wait 2 : ACCEPTED"""


def running(world: World) -> None:
    """Have a task drive, and another one wait."""
    check(world, RUNNING)


#: what the first one is doing; lost: it would go on by itself
STATES = {
    "running": RUNNING,
    "lost": f"{RUNNING}\nfault silent=1 & wait 1.5 : -",
    "paused": f"{RUNNING}\nPAUSE & wait 3 : ACCEPTED",
    "held": f"{RUNNING}\nreboot & until 1 HELD : -",
    "waiting": "PAUSE & wait 1 : ACCEPTED\nTASK_MOVE 9 & wait 1 : ACCEPTED",
    "scheduled": "TASK_MOVE 9 0 0 0 0 8 & wait 1 : ACCEPTED",
    "idle": "wait 1 : -",
    "stopped": f"{RUNNING}\nTASK_STOP & wait 3 : ACCEPTED",
}
STOP, RESUME = "TASK_STOP", "DO_PAUSE_CONTINUE 1"
OTHERS = ("DO_PAUSE_CONTINUE 0", RESUME, "COMPONENT_ARM_DISARM 1 to=autopilot")
#: each state with the words that mean most, and the other words where there is something to undo
CASES = [(state, word) for state in STATES for word in ("", STOP)]
CASES += [(state, word) for state in ("running", "waiting", "stopped") for word in OTHERS]


@directions
@for_each("state, word", some(CASES, *range(0, len(CASES), 3)))
def test_nothing_of_the_old_ones_control_reaches_the_new_one(
    make_world: MakeWorld, old: str, new: str, state: str, word: str
) -> None:
    """The word is read in the turn in which the new one is first heard."""
    world = make_world(persona=PERSONAS[old])
    check(world, STATES[state])
    was_stopped = world.paused() is R.STOPPED
    swapped = Swapped(
        world, PERSONAS[new], at_first_beat=(lambda: ask(world, word)) if word else lambda: None
    )
    world.run(10)
    assert swapped.met_at is not None
    swapped.check_untouched()
    waits = [task for task in world.tasks() if task.state not in (S.KILLED, S.COMPLETED)]
    if word == STOP or (was_stopped and word != RESUME):
        assert world.paused() is R.STOPPED
    elif waits:
        assert world.paused() in (R.RESTARTED, R.TAKEOVER)
    if word != STOP and state in ("running", "lost", "paused", "held"):
        assert world.state(1) == (S.HELD, R.FRAME_RESET)
    notes = [note.text for note in world.events(VehicleNoted) if "another vehicle" in note.text]
    assert len(notes) == 1


def beat_of(kind: int, autopilot: int, *, seq: int = 0) -> bytes:
    """Return a heartbeat of a vehicle with the first rover's id."""
    mav = common.MAVLink(None, 1, 1)
    mav.seq = seq
    raw: bytes = common.MAVLink_heartbeat_message(kind, autopilot, 1, 0, 4, 3).pack(mav)
    return raw


def forge(world: World, kind: int, autopilot: int) -> None:
    """Let the server hear a heartbeat at the first rover's address."""
    world.from_vehicle_side(beat_of(kind, autopilot), peer="rover1")
    world.run(0.01)


def notes_of(world: World) -> list[str]:
    return [note.text for note in world.events(VehicleNoted)]


@for_each("persona, forged", [(PROMPT, PX4), (PROMPT_PX4, ARDUPILOT)])
@for_each("kind", [ROVER, COPTER])
def test_one_wrong_heartbeat_stops_the_rover_and_loses_no_task(
    make_world: MakeWorld, persona: Persona, forged: int, kind: int
) -> None:
    world = make_world(persona=persona)
    running(world)
    forge(world, kind, forged)
    check(world, "wait 5 : - it STANDS / mode hold / task 1: HELD FRAME_RESET / task 2: QUEUED")
    assert any("is another vehicle now" in text for text in notes_of(world))
    place = world.pose()
    world.run(20)
    assert world.pose() == place
    check(
        world,
        """
TASK_RELEASE 1 1 & wait 1 : ACCEPTED
CONTINUE & idle 2 : ACCEPTED task 1: COMPLETED / task 2: COMPLETED
""",
    )


@for_each("autopilot, words", [(ARDUPILOT, {(LOITER, 0.0, 0.0)}), (PX4, {(SET_MODE, 4.0, 3.0)})])
def test_what_is_no_rover_is_asked_to_stay_and_never_driven(
    world: World, autopilot: int, words: set[tuple[int, float, float]]
) -> None:
    """A copter may be in the air: it is not disarmed either. Then the rover is back."""
    running(world)
    world.observers.clear()  # whose rules are for a rover
    world.leave(world.rover_parties[0])
    got: list[Any] = []
    decoder = common.MAVLink(None)
    forge(world, COPTER, autopilot)
    world.watched.on_arrival = lambda _name, _source, data: got.append(
        decoder.decode(bytearray(data))
    )

    def passes(seconds: int) -> None:
        for _ in range(seconds):
            forge(world, COPTER, autopilot)
            world.run(0.99)

    def commands() -> set[tuple[int, float, float]]:
        assert not [message for message in got if message.get_msgId() == SETPOINT]
        sent = [message for message in got if message.get_msgId() == MODE_COMMAND]
        return {(message.command, message.param2, message.param3) for message in sent}

    passes(3)
    assert commands() <= words  # it was in the place of a driven one
    got.clear()
    passes(3)
    assert commands() == set()
    world.client.stop()
    passes(1)
    assert commands() == words
    world.client.arm()
    world.client.proceed()
    world.client.move(1.0)
    passes(5)
    assert commands() == words
    assert world.state(1)[0] is S.KILLED
    world.join(world.rover_parties[0])
    world.run(20)
    assert world.paused() is R.STOPPED
    assert world.stands()


def test_another_rover_of_the_same_make_is_told_by_its_unique_id(world: World) -> None:
    """A client asks for the version: nothing else shows that the rover was exchanged."""
    running(world)
    check(world, "PAUSE & wait 10 : ACCEPTED")
    world.replace_rover(switched_on=0.0)
    told = "task 1: HELD FRAME_RESET / queue RESTARTED"
    check(world, f"wait 2 : -\nREQUEST_MESSAGE 148 to=autopilot & wait 1 : - {told}")
    assert any("is another vehicle now" in text for text in notes_of(world))


def test_of_two_with_one_id_none_is_driven_and_commands_say_why(world: World) -> None:
    world.run(2)
    for _ in range(6):
        forge(world, ROVER, PX4)
        world.run(0.99)
    refused = world.client.move(1.0)
    world.run(1)
    assert refused.answer == (FAILED, R.VEHICLE_SILENT)
    assert world.client.said("only STOP works: rover 1 shares its id with another vehicle")
    world.run(20)
    world.client.proceed()
    world.client.move(2.0)
    world.until_idle(tasks=1)
    assert world.states() == [S.COMPLETED]
