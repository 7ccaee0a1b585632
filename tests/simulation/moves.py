"""What the moves of a story do in a world, and how a story is played."""

import heapq
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from math import inf, nan
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Clients, Driving, Queueing, Settings
from mav_tasks.links.memory import Conditions, Radio
from mav_tasks.shell.in_memory import CLIENT_LINK, VEHICLE_LINK
from mav_tasks.tasks.lifecycle import TERMINAL
from rover_sim.faults import Faults
from rover_sim.personas import PERSONAS, Mode
from tests.kit.client import (
    ARM,
    DRIVE,
    MOVE,
    PAUSE_CONTINUE,
    ROTATE,
    SET_MODE,
    STOP,
    FakeClient,
    command_long,
    set_mode,
    setpoint,
    sticks,
)
from tests.kit.mission import Item, Upload
from tests.kit.packets.mutants import Mutants
from tests.kit.words import CANCEL, CLEAR, MISSION_START, RELEASE, REPOSITION, Kind, Said
from tests.kit.world import at
from tests.simulation import invariants
from tests.simulation.fleet import SimulatedFleet
from tests.simulation.judged import JudgedWorld
from tests.simulation.story import HABITS, ROVER, SERVER, Move, Story, drawn_from
from tests.simulation.world import SimulatedWorld

MODIFY, WAYPOINT = 54012, 16
OFTEN = 300  # changes of a start time
REPEATED = 2.0  # s, within which a stock client repeats, unmarked, an unanswered request
NETS = (
    Conditions(delay=0.002),
    Conditions(delay=0.002, jitter=0.02, duplication=0.1),
    Conditions(delay=0.01, jitter=0.05, loss=0.05, duplication=0.1),
    Conditions(delay=0.02, loss=0.2),
)
FAULTS = (
    *(Faults(silent=True), Faults(deaf=True), Faults(silent=True, deaf=True)),
    *(Faults(position_frozen=True), Faults(position_jump=(3.0, 0.0))),
    *(Faults(refuse_arm=True), Faults(refuse_mode=True)),
    *(Faults(withheld=frozenset({0})), Faults(withheld=frozenset({32}))),
)
POSITION_FAULTS = (3, 4)  # to which a real PX4 in HOLD drives after
FOLLOWS = (("RO_SPEED_P", 0.4), ("RO_SPEED_I", 0.5))  # with less, a PX4 car hardly moves
RADIO = 5_760.0, 16_384  # bytes per second, bytes of its buffer


@dataclass
class Found:
    """What has become of a story: the broken rule, if any, and what the world counted."""

    rule: str = ""
    text: str = ""
    at: float = 0.0  # s, of the story
    digest: int = 0
    counts: Counter[str] = field(default_factory=Counter)


def play(story: Story, *, until: float | None = None) -> Found:
    """Play a story to its end, or up to a time; return what was found."""
    with TemporaryDirectory(prefix="story-") as folder:
        player = _Player(story, Path(folder))
        world, rule, text = player.world, "", ""
        try:
            player.play(until)
        except Exception as error:  # noqa: BLE001 - whatever is raised is a finding
            text = "\n".join([f"{error}", *getattr(error, "__notes__", ())])
            rule = f"{type(error).__name__}: {error}".partition("\n")[0]
        finally:
            world.close()
        return Found(rule, text, world.now - player.begins, world.digest, world.counts)


class _Player:
    def __init__(self, story: Story, folder: Path) -> None:
        cast, self._story = story.cast, story
        settings = Settings(
            driving=Driving(max_speed=1.0),
            queueing=Queueing(
                capacity=20, quota=30, preemption_gap=cast.preemption_gap, preemption_rest=0.3
            ),
            on_restart=cast.on_restart,
            on_failure=cast.on_failure,
            clients=Clients(stream_interval=0.5),
        )
        persona = (
            PERSONAS[cast.make].on(cast.frame)
            if cast.frame.value != "skid"
            else PERSONAS[cast.make]
        )
        make = SimulatedFleet if cast.gateways else SimulatedWorld
        self.world: JudgedWorld = make(
            folder, cast, seed=drawn_from(story.seed), persona=persona, settings=settings
        )
        for vehicle in self.world.rovers:
            vehicle.autopilot.parameters[persona.speed_parameter] = 0.8
            for name, value in FOLLOWS if "RO_SPEED_P" in vehicle.autopilot.parameters else ():
                vehicle.autopilot.parameters[name] = value
        self.world.net.conditions = NETS[0]
        self.world.later = self._later
        self._modes = {mode.name: number for mode, number in persona.modes.numbers.items()}
        self._is_px4 = self.world.observers[0].ways.sub_modes
        self.begins = 0.0  # s, when the story begins, by the world's clock
        self._due: list[tuple[float, int, int, Callable[[], object]]] = []
        self._count = count()
        self._said: dict[int, Said] = {}  # by the number of the move
        self._other = self.world.net.link("another station")

    def play(self, until: float | None) -> None:
        world, story = self.world, self._story
        world.ready()
        begins = self.begins = world.now
        for move in story.moves:
            act: Callable[[], object] = partial(self._do, move)
            heapq.heappush(self._due, (begins + move.at, move.number, next(self._count), act))
        end = begins + (story.seconds if until is None else until)
        while world.step(end=max(world.now, min(end, self._next()))) or self._next() <= end:
            while self._next() <= world.now:
                heapq.heappop(self._due)[3]()
        if until is None:
            self._end()

    def _next(self) -> float:
        return self._due[0][0] if self._due else inf

    def _end(self) -> None:
        """Let whatever was begun come to its end, and judge what must hold then."""
        world = self.world
        while self._due:
            when, number, _, act = heapq.heappop(self._due)
            if number < 0:  # no move: the end of one
                world.run(max(0.0, when - world.now))
                act()
        world.calm()
        world.delayed.clear()
        world.net.conditions = NETS[0]
        world.net.buffers.clear()
        world.disturb(0)
        for name, check in (("way out", invariants.way_out), ("STOP", invariants.stops)):
            for text in check(world):
                raise world.violation(name, text)
        world.judge(world.now, everything=True)

    def _later(self, seconds: float, act: Callable[[], object]) -> None:
        when, number = self.world.now + seconds, -len(self._due) - 1
        heapq.heappush(self._due, (when, number, next(self._count), act))

    def _do(self, move: Move) -> None:
        words, before = self.world.words, len(self.world.words.recent)
        who, _, number = move.who.partition(" ")
        self.world.counts[move.what] += 1
        latest = words.recent[-1] if before else None
        match who:
            case "client":
                client = self.world.clients[int(number)]
                self._client(client, HABITS[self._story.cast.habits[int(number)]][1], move)
            case "person":
                self._person(int(move.who[-1]), move)
            case "rover":
                self._rover(int(number), move)
            case "net" | "another":
                self._net(move)
            case _:
                self.world.fails(move)
        if words.recent and words.recent[-1] is not latest:
            self._said[move.number] = words.recent[-1]

    # clients

    def _client(self, client: FakeClient, repeats: tuple[float, ...], move: Move) -> None:
        what, args = move.what, move.args
        rover: int = args[0] if args and type(args[0]) is int else 1

        def say(command: int, *params: float, to: int = SERVER, system: int = rover) -> None:
            client.command(command, *params, target=(system, to), repeats=repeats)

        match what:
            case "move":
                _, _, metres, nonce, priority = args
                say(MOVE, metres, 0, 0, nonce, 0, 0, priority)
            case "rotate":
                say(ROTATE, args[2], 0, 0, args[3], 0, 0, args[4])
            case "drive":
                say(DRIVE, args[2], 0, 3, args[3], 0, 0, args[4])
            case "later task":
                say(MOVE, 0.5, 0, 0, move.number + 1, 0, args[1], 5)
            case "continue" | "pause":
                say(PAUSE_CONTINUE, int(what == "continue"), to=args[1])
            case "STOP":
                say(STOP, args[2])
            case "arm" | "disarm":
                say(ARM, int(what == "arm"), to=ROVER)
            case "mode":
                self._mode(say, args[1])
            case "SET_MODE":
                client.send(set_mode(self._modes[args[1]], system=rover))
            case "release":
                say(RELEASE, 0, args[1])
            case "start of the mission":
                say(MISSION_START, to=ROVER)
            case "cancel":
                say(CANCEL, self._task(args[1]), args[2])
            case "clear":
                say(CLEAR, args[1])
            case "modify":
                say(MODIFY, self._task(args[1]), args[2], args[3])
            case "moves a start often":
                for number in range(OFTEN):
                    later = partial_modify(client, self._task(-1), rover, 400 - number)
                    self._later(number * 0.02, later)
            case "go-to":
                if self._is_px4:  # as MAVSDK does
                    self._mode(say, "HOLD")
                place = at(args[1], args[2])
                client.command_int(
                    *(REPOSITION, -1, 1, 0, nan), **place, frame=6, target=(rover, ROVER)
                )
            case "upload":
                places = [at(*args[2:4]), at(*args[4:6])]
                home = [] if self._is_px4 or args[1] == SERVER else [Item(WAYPOINT, frame=0)]
                items = [*home, *(Item(WAYPOINT, **place) for place in places)]
                Upload(client, items, target=(rover, args[1]))
            case "sticks":
                client.send(sticks(args[1], system=rover))
            case "setpoint":
                client.send(setpoint(args[1], system=rover))
            case "streams setpoints":
                client.stream(setpoint(args[1], system=rover), rate=20)
            case "streams no more":
                client.end_streams()
            case "parameter":
                name = args[1].encode()
                client.send(common.MAVLink_param_set_message(rover, SERVER, name, args[2], 9))
            case "the net swaps its next two":
                self.world.swap_next_two(client.name)
            case "once more":
                self._once_more(*args)
            case _:
                raise ValueError(move)

    def _mode(self, say: Callable[..., None], name: str) -> None:
        mode = self._modes.get(name, self._modes["HOLD"])
        if self._is_px4:
            say(SET_MODE, 1 | 128, mode >> 16 & 0xFF, mode >> 24, to=ROVER)
        else:
            say(SET_MODE, 1, mode, to=ROVER)

    def _task(self, index: int) -> int:
        """Return the id of some task that is not over."""
        live = [task.id for task in self.world.tasks() if task.state not in TERMINAL]
        return live[index % len(live)] if live else index

    def _once_more(self, number: int, how: str) -> None:
        said, world = self._said.get(number), self.world
        if said is None or said.first.at < world.started_at:
            return  # a server knows no copies of what only an earlier one has heard
        is_command = said.message.get_type() in ("COMMAND_LONG", "COMMAND_INT")
        is_old = world.now - said.first.at > REPEATED or self._is_over(said)
        is_old &= not (said.name == "submission" and said.message.param4)  # that has a nonce
        if how == "the same packet" or not is_command or (how == "with a new number" and is_old):
            world.net.send(said.client.name, said.client.server, said.data)
        elif how == "confirmed higher" and said.message.get_type() == "COMMAND_LONG":
            fields = [getattr(said.message, name) for name in said.message.fieldnames]
            fields[said.message.fieldnames.index("confirmation")] = 3
            world.repeat(said, common.MAVLink_command_long_message(*fields))
        elif how == "with a new number":
            world.repeat(said, said.message)

    def _is_over(self, said: Said) -> bool:
        """Return whether its client has sent a halt by the same command since: no repeats."""
        return any(
            later.kind is Kind.HALT
            and later.client is said.client
            and later.first.order > said.first.order
            and later.message.command == getattr(said.message, "command", 0)
            for later in self.world.words.recent
        )

    # people, rovers, and everything around the server

    def _person(self, rover: int, move: Move) -> None:
        if move.what == "arms":
            self.world.person_arms(rover, armed=move.args[0])
        else:
            self.world.person_turns(rover, Mode[move.args[0]])

    def _rover(self, rover: int, move: Move) -> None:
        world, autopilot = self.world, self.world.rovers[rover - 1].autopilot
        world.disturb(rover)
        world.doubt(rover)
        match move.what:
            case "fails" if self._is_px4 and move.args[0] in POSITION_FAULTS:
                pass
            case "fails":
                autopilot.set_faults(FAULTS[move.args[0]])
            case "is well again":
                autopilot.set_faults(Faults())
            case _:
                autopilot.reboot(now=world.now)

    def _net(self, move: Move) -> None:
        world, args = self.world, move.args
        match f"{move.who} {move.what}":
            case "net loses and delays":
                world.net.conditions = NETS[args[0]]
                world.disturb(0)
            case "net delays a command to the rover":
                world.delayed[f"rover{args[0]}"] = args[1]
            case "net radio" | "net no radio":
                self._radio(is_there=not move.what.startswith("no"))
            case "net link down":
                world.link_down(*args)
            case "net junk":
                self._junk(Random(args[0]))
            case "another station go-to":
                place = at(args[1], args[2])
                go_to = common.MAVLink_command_int_message(
                    *(args[0], 1, 6, REPOSITION, 0, 0, -1, 1, 0, nan), *place.values(), 0
                )
                self._other.send(f"rover{args[0]}", go_to.pack(common.MAVLink(None, 255, 190)))
            case _:
                raise ValueError(move)

    def _radio(self, *, is_there: bool) -> None:
        net = self.world.net
        net.buffers.clear()
        self.world.disturb(0)
        for rover in self.world.rovers if is_there else ():
            name = f"rover{rover.autopilot.address.system_id}"
            for way in ((name, VEHICLE_LINK), (VEHICLE_LINK, name)):
                net.buffers[way] = Radio(bytes_per_second=RADIO[0], buffer=RADIO[1])

    def _junk(self, random: Random) -> None:
        """Send broken packets, from strangers and from known senders."""
        mutants = Mutants(random)
        for _ in range(20):
            link, peers = random.choice(
                ((CLIENT_LINK, ("client 0", "stranger")), (VEHICLE_LINK, ("rover1", "stranger")))
            )
            self.world.net.send(random.choice(peers), link, mutants.broken().data)


def partial_modify(client: FakeClient, task: int, rover: int, start: float) -> Callable[[], object]:
    """Return a call that moves the start of a task."""
    message = command_long(MODIFY, task, 2, start, target=(rover, SERVER))
    return lambda: client.send(message)
