"""The invariants of the simulation: what must hold whatever happens. This is the whole list.

Each takes the world and yields what is wrong. Those in ``INVARIANTS`` are asked in their period;
the others where a server starts, or where an event says that something has happened.

``kit/observer.py`` has the rules about packets, ``kit/halts.py`` the rule about halted rovers.
``ledger.py`` follows tasks over all servers: none is lost, doubled or changed after its end.
"""

from collections.abc import Callable, Iterator
from math import hypot
from typing import TYPE_CHECKING

from mav_tasks.tasks.lifecycle import TERMINAL, TaskReason, TaskState
from mav_tasks.tasks.restored import Restored
from rover_sim.faults import Faults
from rover_sim.personas import Mode
from rover_sim.vehicle import Vehicle
from tests.kit.bounds import too_large
from tests.kit.client import DRIVE, MOVE, ROTATE
from tests.kit.halts import STALLED, Halts
from tests.kit.observer import Observer
from tests.kit.words import CLEAR

if TYPE_CHECKING:
    from tests.simulation.judged import JudgedWorld as World

TASKS = (MOVE, ROTATE, DRIVE)
STANDS = 0.03  # m/s and rad/s
STOPS_WITHIN = 3.0  # s, from the highest speed here to standstill; also of one that is disarmed
CAR_STOPS_WITHIN = 9.0  # s; a real car rolls on, its speed halves in 1.4 s
TIMES_OUT = 3.0  # s, until a rover that does not hear a STOP stops by itself
FLASH = 0.15  # s of motion until it counts: a mode may be entered and left between two looks
UNHEARD = 6.0  # s after a fault on the way to the rover
BY_ITSELF = frozenset({Mode.MANUAL, Mode.POSITION, Mode.AUTO, Mode.RTL, Mode.LAND})
ANSWERED = 12.0  # s, until every command has its answer
TOLERANCE, SHARE = 0.25, 0.05  # m or rad, and of the goal: what a completed task may lack
COMPLETES = 90.0  # s, for a metre on the way out


def packets(world: "World") -> Iterator[str]:
    """No packet to a rover breaks a rule of the observer."""
    for observer in world.observers:
        for text in observer.violations:
            yield f"rover {observer.system_id}: {text}"


def halted(world: "World") -> Iterator[str]:
    """A halted rover stands until a newer request releases it."""
    for halts in world.halts:
        for broken in halts.look(world.now):
            yield f"rover {halts.system_id} is let go after {broken.kind}"


def undriven(world: "World") -> Iterator[str]:
    """A rover that nobody drives stands, and so does one after a STOP."""
    for still in world.stillness:
        yield from still.look(world.now)


def kept(world: "World") -> Iterator[str]:
    """The server has every task that it acknowledged, in the state that its events say."""
    if not world.is_away:
        yield from world.ledger.compare(world.tasks())


def answered(world: "World") -> Iterator[str]:
    """Every command is answered, once for each copy at the most."""
    for (peer, command), asked in world.asked.items():
        if not world.is_away and world.now - max(asked.latest, world.disturbed_at) > ANSWERED:
            yield f"command {command} of {peer} is not answered"


def bounded(world: "World") -> Iterator[str]:
    """The server's memory is bounded: no container is larger than its bound."""
    for engine in world.engines():
        yield from too_large(engine)


#: name: seconds between two looks, and what is asked
INVARIANTS: dict[str, tuple[float, Callable[["World"], Iterator[str]]]] = {
    "packets to rovers": (0.0, packets),
    "halted rovers stand": (0.025, halted),
    "undriven rovers stand": (0.025, undriven),
    "tasks are kept": (1.0, kept),
    "commands are answered": (1.0, answered),
    "memory is bounded": (20.0, bounded),
}


# asked where a server starts, or an event says that something has happened


def lost_halts(halts: Halts, restored: Restored) -> Iterator[str]:
    """A halt that was acknowledged outlives its server."""
    rover, name = halts.system_id, halts.in_force
    paused = restored.paused.get(rover, TaskReason.NONE)
    if name == "STOP" and paused is not TaskReason.STOPPED:
        yield f"STOP of rover {rover} was acknowledged, and is lost by the restart"
    elif name == "pause" and paused is TaskReason.NONE:
        yield f"a pause of rover {rover} was acknowledged, and is lost by the restart"
    elif name == "disarm" and rover not in restored.disarmed:
        yield f"disarming rover {rover} was acknowledged, and is lost by the restart"


def not_driven(world: "World", task_id: int) -> Iterator[str]:
    """No task is completed that its rover has not driven."""
    driven = world.driven[task_id]
    way = world.ways[driven.rover - 1]
    metres, radians = way.metres - driven.since.metres, way.radians - driven.since.radians
    for done, goal, unit in ((metres, driven.metres, "m"), (radians, driven.radians, "rad")):
        if driven.is_judged and done < goal * (1 - SHARE) - TOLERANCE:
            yield f"task {task_id} is completed after {done:.2f} of {goal:.2f} {unit}"


def taken_from_halted(world: "World", task_id: int, rover: int) -> Iterator[str]:
    """What a person has halted keeps its tasks."""
    for halts in world.halts:
        if halts.system_id == rover and halts.in_force not in ("", STALLED):
            yield f"task {task_id} is taken from rover {rover} after {halts.in_force}"


def way_out(world: "World") -> Iterator[str]:
    """However a story ends, a person can clear, set HOLD, arm and resume, and a task completes."""
    _quiet(world)
    person = world.client = world.listened(world.add_client("rescuer", system_id=100))

    def clear(number: int) -> None:
        person.command(CLEAR, 1, target=(number, 191), repeats=(0.0, 1.0, 2.0))

    for number in range(1, len(world.rovers) + 1):
        clear(number)
    world.run(4)
    for number, rover in enumerate(world.rovers, 1):
        if rover.autopilot.mode is not Mode.HOLD:
            world.person_turns(number, Mode.HOLD)
            world.run(3)
        clear(number)  # a task whose rover drove on by itself was held, not cancelled
        world.run(3)
        world.person_arms(number, armed=True)
        world.run(1.2)
        for _ in range(2):
            person.proceed(target=(number, 191))
            world.run(1)
        sent = person.move(1.0, nonce=(1 << 24) - number, target=(number, 191))
        world.run(1)
        if sent.ack is None or sent.result != 0:
            yield f"no way out of rover {number}: a task is answered {sent.answer}"
            return
        done = lambda: world.state(sent.task_id)[0] is TaskState.COMPLETED  # noqa: B023, E731
        if not world.run_until(done, within=COMPLETES):
            state, reason = world.state(sent.task_id)
            yield f"no way out of rover {number}: its task is {state.name} ({reason.name})"


def stops(world: "World") -> Iterator[str]:
    """STOP stops every rover and ends every task."""
    for number in range(1, len(world.rovers) + 1):
        world.client.stop(clear=True, target=(number, 191), repeats=(0.0, 0.3, 0.6))
    world.run(8)
    for number, rover in enumerate(world.rovers, 1):
        if not world.stands(number):
            yield f"{rover!r} does not stand in the end"
    for task in world.tasks():
        if task.state not in TERMINAL:
            yield f"task {task.id} is {task.state.name} in the end"


def _quiet(world: "World") -> None:
    for rover in world.rovers:
        rover.autopilot.set_faults(Faults())
    for client in world.clients:
        client.end_streams()
    world.run(8)


class Stillness:
    """Checks one rover's true motion."""

    def __init__(self, vehicle: Vehicle, observer: Observer, *, stops_within: float) -> None:
        self._stops_within = stops_within
        self.vehicle = vehicle
        self.observer = observer
        #: time of the last fault of the rover, or of the way to it
        self.disturbed_at = -1e9
        self._by_itself_at = -1e9
        self._stood_at = -1e9

    def look(self, now: float) -> Iterator[str]:
        """Yield the present violations."""
        autopilot = self.vehicle.autopilot
        if autopilot.armed and autopilot.mode in BY_ITSELF:
            self._by_itself_at = now
        truth = self.vehicle.truth
        speed = max(hypot(truth.forward_speed, truth.lateral_speed), abs(truth.yaw_rate))
        if speed <= STANDS:
            self._stood_at = now
        coasts = self._stops_within
        if now - self._stood_at <= FLASH or now - self._by_itself_at <= coasts:
            return
        number, observer = self.observer.system_id, self.observer
        if now > observer.may_move_until + coasts:
            yield f"rover {number} moves, and nobody drives it"
        heard = now - self.disturbed_at > UNHEARD
        bound = coasts if heard else coasts + TIMES_OUT
        if observer.stopped and now - observer.stopped_at > bound and not self._is_pushed(now):
            yield f"rover {number} moves, {now - observer.stopped_at:.1f} s after STOP"

    def _is_pushed(self, now: float) -> bool:
        """Return whether another station has sent the rover somewhere, bypassing the server."""
        return self.observer.may_move_until > now + self._stops_within + TIMES_OUT
