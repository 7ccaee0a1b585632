"""A story: who takes part, and a plain list of moves with their times, all drawn from one seed.

Nothing in a story depends on what happens in the world, so moves can be left out, and the rest is
the same. What a move does is in ``moves.py``.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from random import Random
from typing import Any, NamedTuple

from rover_sim.frames import Frame

SERVER, ROVER, ANY = 191, 1, 250  # components; ANY is the server's system
MODES = ("MANUAL", "HOLD", "AUTO", "RTL", "GUIDED")
MAKES = ("ardupilot", "px4", "generic")
FRAMES = (Frame.SKID, Frame.SKID, Frame.ACKERMANN)
#: name: heartbeats, and when it sends an unanswered command again, s
HABITS: dict[str, tuple[bool, tuple[float, ...]]] = {
    "ground station": (True, (0.0, 3.0, 6.0)),
    "MAVSDK": (True, (0.0, 0.5, 1.0)),
    "script": (False, (0.0,)),
}
THEMES = 11  # each story has one, and they meet each make in turn; then comes one with gateways
GATEWAYS = ("server", "b", "c")
PAUSES = (0.01, 0.5, 3.0, 6.0)  # s, between two plots
AFTER = (0.3, 1.0, 3.0, 8.0)  # s, between the moves of a plot
NETS = 4  # see moves.py
DRIVES_AFTER = 3.0  # s, until a task moves a rover
SHOWN_AFTER = 5.0  # s, until it is seen that a rover does not stand
REMEMBERED = 20.0  # s, the oldest request that the net brings once more


class Move(NamedTuple):
    """One thing that somebody does; ``number`` is its name in the story."""

    at: float  # s
    number: int
    who: str
    what: str
    args: tuple[Any, ...] = ()

    def __str__(self) -> str:
        words = ", ".join(f"{each:.2f}" if type(each) is float else f"{each}" for each in self.args)
        return f"{self.at:7.2f} s  {self.who}: {self.what}{words and f' ({words})'}"


@dataclass(frozen=True, slots=True)
class Cast:
    """The rovers, clients and settings of a story."""

    make: str
    frame: Frame
    rovers: int
    habits: tuple[str, ...]  # of the clients, by number; the first's link is the server's first
    on_restart: str
    on_failure: str
    preemption_gap: int
    gateways: int = 0  # 0: one server with its own disk

    def __str__(self) -> str:
        kind = f"{self.make} ({self.frame.value})"
        servers = f", {self.gateways} gateways" if self.gateways else ""
        habits = ", ".join(self.habits)
        return f"{self.rovers} {kind}{servers}, {habits}, on_restart={self.on_restart}"


@dataclass(frozen=True, slots=True)
class Story:
    """A cast and its moves, in order."""

    seed: int
    cast: Cast
    seconds: float
    moves: tuple[Move, ...]

    def __str__(self) -> str:
        return "\n".join([f"seed {self.seed}: {self.cast}", *map(str, self.moves)])

    def without(self, numbers: set[int]) -> "Story":
        """Return the story without some moves."""
        return replace(self, moves=tuple(m for m in self.moves if m.number not in numbers))


def tell(seed: int, seconds: float) -> Story:
    """Return the story of a seed."""
    return _Teller(seed).story(seconds)


def drawn_from(seed: int) -> int:
    """Return the seed of all chance in a story: stories with gateways do not count."""
    return seed - seed // (THEMES + 1)


#: what a plot yields: seconds after the plot's move before, who, what, its arguments
Plan = Iterator[tuple[float, str, str, tuple[Any, ...]]]


class _Teller:
    def __init__(self, seed: int) -> None:
        self._seed, self._number = seed, (number := drawn_from(seed))
        self._random = random = Random(number)
        count = random.choice((2, 3, 4))
        self._cast = Cast(
            make=(make := MAKES[number // THEMES % len(MAKES)]),
            frame=random.choice(FRAMES) if make != "generic" else Frame.SKID,
            rovers=random.choice((2, 3) if number % THEMES == 0 else (1, 1, 1, 2, 3)),
            habits=tuple(random.choice(tuple(HABITS)) for _ in range(count)),
            on_restart=random.choice(("pause", "continue")),
            on_failure=random.choice(("pause", "continue")),
            preemption_gap=random.choice((0, 3)),
            gateways=random.choice((2, 3)) if seed % (THEMES + 1) == THEMES else 0,
        )
        self._moves: list[Move] = []
        self._at = 0.0

    def story(self, seconds: float) -> Story:
        plots = self._chosen()
        while self._at < seconds:
            at = self._at
            for after, who, what, args in self._random.choice(plots)():
                at += after
                if who != "nobody":
                    self._moves.append(Move(round(at, 3), len(self._moves), who, what, args))
            self._at = (at if self._random.random() < 0.75 else self._at) + self._pick(*PAUSES)
        return Story(self._seed, self._cast, seconds, tuple(sorted(self._moves)))

    def _chosen(self) -> list[Callable[[], Plan]]:
        """Return what happens in this story: mostly one kind of trouble, so that it goes deep."""
        themes = [
            *(self._any_rover, self._halt_then_copy, self._overtaken, self._comes_late),
            *(self._read_later, self._frozen, self._halt_and_end, self._parked, self._stopped),
            *(self._moved_start, self._halted_while_waiting),
        ]
        others = [
            *(self._drive_all, self._person, self._rover_fails, self._net_changes),
            *(self._server_fails, self._disk_fails, self._copy, self._pick(*themes)),
        ]
        if self._cast.gateways:
            more = self._person, self._rover_fails, self._net_changes, self._copy
            of_clients = self._halt_then_copy, self._overtaken, self._stopped, self._parked
            others = [self._drive_all, self._pick(*more), self._pick(*of_clients)]
            return [self._request, *others, *[self._gateway_fails] * 6]
        theme = themes[self._number % THEMES]
        return [self._works, self._request, *self._random.sample(others, 3), *[theme] * 4]

    # parts of moves

    def _pick(self, *choices: Any) -> Any:
        return self._random.choice(choices)

    def _one_of(self, *requests: tuple[str, tuple[Any, ...]]) -> tuple[str, tuple[Any, ...]]:
        return self._random.choice(requests)

    def _client(self) -> str:
        return f"client {self._random.randrange(len(self._cast.habits))}"

    def _rover(self) -> int:
        return self._random.randint(1, self._cast.rovers)

    def _nonce(self) -> int:
        return self._random.randrange(1, 1 << 24)

    def _task(self, rover: int, *, component: int = SERVER) -> tuple[str, tuple[Any, ...]]:
        pick, nonce = self._pick, self._nonce() if self._random.random() < 0.8 else 0
        if self._random.random() < 0.8:
            priority = pick(1, 5, 5, 9)
            return "move", (rover, component, pick(-1.0, 0.5, 2.0, 8.0), nonce, priority)
        if self._random.random() < 0.5:
            return "rotate", (rover, component, self._random.uniform(-90, 90), nonce, 5)
        return "drive", (rover, component, pick(0.3, -0.3), nonce, 5)

    def _halt(self, rover: int) -> tuple[str, tuple[Any, ...]]:
        return self._one_of(
            ("STOP", (rover, SERVER, self._pick(0, 1))),
            ("pause", (rover, self._pick(SERVER, ROVER))),
            ("mode", (rover, "HOLD")),
            ("disarm", (rover,)),
        )

    def _go(self, rover: int) -> tuple[str, tuple[Any, ...]]:
        if self._random.random() < 0.5:
            return "continue", (rover, SERVER)
        return self._one_of(
            ("continue", (rover, ROVER)),
            ("release", (rover, self._random.randrange(3))),
            ("start of the mission", (rover,)),
            ("mode", (rover, self._pick("AUTO", "AUTO", "RTL", "GUIDED"))),
            ("arm", (rover,)),
        )

    def _places(self) -> tuple[Any, ...]:
        return tuple(round(self._random.uniform(-4, 4), 2) for _ in range(2))

    def _wait(self, seconds: float = SHOWN_AFTER) -> tuple[float, str, str, tuple[Any, ...]]:
        return seconds, "nobody", "waits", ()

    # plots

    def _drive_all(self) -> Plan:
        """Somebody lets all rovers go, and has work for them."""
        client = self._client()
        for rover in range(1, self._cast.rovers + 1):
            if self._random.random() < 0.4:
                yield 0.0, client, "mode", (rover, "HOLD")
            yield 0.05, client, "continue", (rover, SERVER)
            yield 0.05, client, *self._task(rover)

    def _free(self, rover: int, client: str) -> Plan:
        """Nothing holds a rover any more: it waits for work."""
        if self._random.random() < 0.8:
            yield 0.0, client, "clear", (rover, 1)
            yield 0.1, f"person at rover {rover}", "switch", ("HOLD",)
            yield 0.1, f"person at rover {rover}", "arms", (True,)
            yield 1.5, client, "continue", (rover, SERVER)
        elif self._random.random() < 0.5:
            yield 0.0, client, "mode", (rover, "HOLD")
        yield 0.1, client, "continue", (rover, SERVER)

    def _set_off(self, rover: int, client: str) -> Plan:
        """Somebody lets a rover go, and it drives."""
        yield from self._free(rover, client)
        yield 0.0, client, "move", (rover, SERVER, 8.0, self._nonce(), 5)
        yield self._wait(DRIVES_AFTER)

    def _works(self) -> Plan:
        """A rover has work, and whatever comes next meets it driving."""
        yield from self._set_off(self._rover(), self._client())

    def _request(self) -> Plan:
        rover, pick, random = self._rover(), self._pick, self._random
        yield (
            0.0,
            self._client(),
            *pick(
                self._task(rover),
                self._task(rover),
                self._go(rover),
                self._go(rover),
                self._halt(rover),
                ("go-to", (rover, *self._places())),
                ("upload", (rover, pick(SERVER, ROVER), *self._places(), *self._places())),
                ("cancel", (rover, random.randrange(9), pick(0, 1))),
                ("clear", (rover, pick(0, 1))),
                ("modify", (rover, random.randrange(9), random.randrange(1, 8), pick(0, 3, 10))),
                ("later task", (rover, pick(2.0, 6.0, 15.0))),
                ("mode", (rover, pick(*MODES))),
                ("SET_MODE", (rover, pick(*MODES))),
                ("sticks", (rover, pick(0, 300))),
                ("setpoint", (rover, 0.3)),
                ("streams setpoints", (rover, 0.3)),
                ("streams no more", ()),
                ("parameter", (rover, pick("TSK_SPEED", "TSK_TURN", "TSK_ACCEL", "none"), 0.4)),
            ),
        )

    def _person(self) -> Plan:
        rover = f"person at rover {self._rover()}"
        if self._random.random() < 0.6:
            yield 0.0, rover, "switch", (self._pick("HOLD", "HOLD", *MODES),)
        else:
            yield 0.0, rover, "arms", (self._random.random() < 0.6,)

    def _rover_fails(self) -> Plan:
        rover = f"rover {self._rover()}"
        if self._random.random() < 0.2:
            yield 0.0, rover, "restarts", ()
            return
        yield 0.0, rover, "fails", (self._random.randrange(9),)
        yield self._pick(0.5, 2.0, 6.0), rover, "is well again", ()

    def _net_changes(self) -> Plan:
        match self._random.randrange(5):
            case 0:
                yield 0.0, "net", "loses and delays", (self._random.randrange(NETS),)
            case 1:
                yield 0.0, "net", "radio", ()
                yield self._pick(4.0, 10.0), "net", "no radio", ()
            case 2:
                yield 0.0, "net", "link down", (self._rover(), self._pick(0.2, 1.0, 4.0))
            case 3:
                yield 0.0, "net", "junk", (self._nonce(),)
            case _:
                client, rover = self._client(), self._rover()
                yield 0.0, "another station", "go-to", (rover, *self._places())
                yield 2.0, client, "mode", (rover, "HOLD")

    def _server_fails(self) -> Plan:
        how = self._pick("SIGKILL", "SIGTERM", "dies at a write", "dies at a write")
        details = (self._pick(1, 2, 3, 8), self._pick("before", "after")) if " " in how else ()
        yield 0.0, "server", how, (self._pick(0.5, 3.0, 8.0), *details)
        if self._random.random() < 0.3:
            yield 0.0, "clock", "jumps", (self._pick(-3600.0, -1.0, 1.0, 86_400.0),)

    def _gateway_fails(self) -> Plan:
        """A gateway, or its way to the database or to the rovers, fails under a driving rover."""
        if self._random.random() < 0.8:
            yield from self._works()
        name = self._pick(*GATEWAYS[: self._cast.gateways])
        what = self._pick(
            *("SIGKILL", "SIGTERM", "stands still", "does not reach the database"),
            *("does not reach the rovers", "loses its session", "hears no answers"),
            *("is not pinged", "loses its database"),
        )
        yield 0.0, f"gateway {name}", what, (self._pick(0.3, 1.5, 4.0),)

    def _disk_fails(self) -> Plan:
        what, value = self._pick(
            ("is full for", 2.0), ("is full for", 5.0), ("takes", 0.1), ("takes", 2.0)
        )
        yield 0.0, "disk", what, (value,)
        if what == "takes":
            yield 4.0, "disk", "takes", (0.0,)

    def _copy(self) -> Plan:
        """An earlier request comes once more."""
        told = [
            m for m in self._moves if m.who.startswith("client") and self._at - m.at < REMEMBERED
        ]
        if told:
            move = self._random.choice(told)
            yield self._brought(move.who, move.number)

    def _brought(self, who: str, number: int) -> tuple[float, str, str, tuple[Any, ...]]:
        how = self._pick("the same packet", "confirmed higher", "with a new number")
        return self._pick(*AFTER), who, "once more", (number, how)

    def _halt_then_copy(self) -> Plan:
        """A go request, a newer halt, then a copy of the go request."""
        client, rover = self._client(), self._rover()
        yield from self._set_off(rover, client)
        first = len(self._moves)
        yield 0.0, client, *self._go(rover)
        yield self._pick(*AFTER), self._client(), *self._halt(rover)
        yield self._brought(client, first)
        yield self._wait()

    def _overtaken(self) -> Plan:
        """Two requests of one client; the second arrives first."""
        client, rover = self._client(), self._rover()
        yield from self._set_off(rover, self._client())  # the server knows a copy of what it said
        yield 0.0, client, "the net swaps its next two", ()
        yield 0.0, client, *self._one_of(("continue", (rover, SERVER)), self._go(rover))
        halt = self._one_of(("pause", (rover, SERVER)), self._halt(rover))
        yield self._pick(0.005, 0.02, 0.2), client, *halt
        yield self._wait()

    def _read_later(self) -> Plan:
        """A go request waits on a link that is read late, perhaps after another link's halt."""
        rover, is_halted = self._rover(), self._random.random() < 0.5
        late = self._pick(0.3, 1.0) if is_halted else 1.0
        yield from self._set_off(rover, self._pick("client 0", "client 1"))
        yield 0.0, "client 0", *self._one_of(("pause", (rover, SERVER)), self._halt(rover))
        yield 3.0, "server", "reads late", (1, late)
        yield 0.01, "client 1", "continue", (rover, SERVER)
        if is_halted:
            yield late - 0.05, "client 0", *self._halt(rover)
        yield self._wait()

    def _frozen(self) -> Plan:
        """The server's process or machine stands still, and everybody goes on."""
        seconds, rover = self._pick(0.6, 1.0, 1.5, 2.0, 5.0, 20.0), self._rover()
        yield from self._set_off(rover, self._client())
        yield 0.0, "server", "stands still", (seconds,)
        for _ in range(self._pick(0, 0, 1, 2)):
            after = self._random.uniform(0.05, seconds / 3)
            yield (
                after,
                self._client(),
                *self._pick(
                    self._go(rover),
                    self._halt(rover),
                    self._task(rover),
                    ("sticks", (rover, 300)),
                    ("setpoint", (rover, 0.3)),
                ),
            )
        yield self._wait(seconds + SHOWN_AFTER)

    def _halt_and_end(self) -> Plan:
        """Somebody halts a rover, and the server ends at once, perhaps on a full or slow disk."""
        rover = self._rover()
        yield from self._set_off(rover, self._client())
        halt, late = self._halt(rover), ("keeps halts after", (0.2,))
        end, disk = self._pick(
            *((halt, late), (halt, late), (halt, ("is full for", (5.0,)))),
            *((("cancel", (rover, 0, 0)), ("takes", (0.3,))), (("clear", (rover, 1)), late)),
        )
        yield 0.0, "disk", *disk
        yield 0.2, self._client(), *end
        how = self._pick("SIGKILL", "SIGKILL", "SIGTERM")
        yield self._pick(0.02, 0.05, 0.1, 0.3), "server", how, (self._pick(0.5, 8.0),)
        yield 0.0, "disk", "takes", (0.0,)

    def _any_rover(self) -> Plan:
        """Tasks for any rover wait; a rover is halted and falls silent."""
        if self._cast.rovers == 1:
            yield from self._works()
            return
        is_later = self._random.random() < 0.8
        for rover in range(1, self._cast.rovers + 1):
            yield from self._free(rover, self._client())
        for _ in range(self._cast.rovers + 1):
            task = ("later task", (ANY, 15.0)) if is_later else self._task(ANY)
            yield 0.1, self._client(), *task
        rover = self._pick(1, self._rover())  # the first has most of them
        if self._random.random() < 0.8:
            yield 1.0, self._client(), *self._one_of(("disarm", (rover,)), self._halt(rover))
        else:
            yield 1.0, f"person at rover {rover}", "arms", (False,)
        yield 1.0, f"rover {rover}", "fails", (2,)
        if self._random.random() < 0.3:
            yield 1.0, "server", "SIGTERM", (0.5,)
        yield 9.0, f"rover {rover}", "is well again", ()

    def _moved_start(self) -> Plan:
        """Somebody moves the start of a task again and again."""
        rover, client = self._rover(), self._client()
        yield from self._free(rover, client)
        yield 0.5, client, "later task", (rover, 30.0)
        yield 1.0, client, "moves a start often", (rover,)
        yield self._wait(7.0)

    def _parked(self) -> Plan:
        """A person drives while a task waits, and parks."""
        rover = self._rover()
        yield from self._pick(self._free, self._free, self._set_off)(rover, self._client())
        yield 1.0, f"person at rover {rover}", "switch", ("MANUAL",)
        yield 0.5, f"person at rover {rover}", "arms", (True,)
        yield 0.5, self._client(), *self._task(rover)
        yield self._pick(*AFTER), f"person at rover {rover}", "switch", ("HOLD",)
        yield self._wait()

    def _stopped(self) -> Plan:
        """Whatever is asked after a STOP, the rover stands until somebody continues."""
        rover = self._rover()
        yield from self._set_off(rover, self._client())
        yield 0.0, self._client(), "STOP", (rover, SERVER, self._pick(0, 1))
        for _ in range(3):
            what = self._one_of(
                ("sticks", (rover, 300)), ("setpoint", (rover, 0.3)), self._go(rover)
            )
            yield self._pick(*AFTER), self._client(), *what

    def _comes_late(self) -> Plan:
        """A command, or a copy of it, reaches a rover after a halt that came later."""
        rover, client = self._rover(), self._client()
        yield from self._free(rover, client)
        led = ("mode", (rover, "GUIDED")), ("mode", (rover, "HOLD"))
        armed = ("arm", (rover,)), ("disarm", (rover,))
        go, halt = self._pick(armed, led, led, (self._go(rover), self._halt(rover)))
        late, after = self._pick((0.5, 0.2), (2.5, 2.0))  # in the second case, a copy came sooner
        if go[0] == "arm":
            yield 0.5, client, "disarm", (rover,)
            late, after = 2.5, 2.0
        yield 1.0, "net", "delays a command to the rover", (rover, late)
        yield 0.0, client, *go
        yield after, self._client(), *halt
        yield self._wait(7.0)

    def _halted_while_waiting(self) -> Plan:
        """Something waits for its time or for an arming; somebody halts the rover first."""
        rover, client = self._rover(), self._client()
        yield 0.0, client, "upload", (rover, ROVER, *self._places(), *self._places())
        yield (
            1.0,
            client,
            *self._pick(
                ("later task", (rover, 6.0)), ("start of the mission", (rover,)), self._task(rover)
            ),
        )
        yield self._pick(0.1, 0.5, 2.0), self._client(), *self._halt(rover)
        yield (
            self._pick(*AFTER),
            self._client(),
            *self._pick(("arm", (rover,)), self._task(rover), self._halt(rover)),
        )
