"""Attacks and bad luck: late copies, overtaken requests, freezes, full disks at the end.

Each of them succeeded once; ``tests/kit/halts.py`` has the rule that they must not break.
"""

from random import Random

from pymavlink.dialects.v20 import common

from mav_tasks.in_memory import VEHICLE_LINK
from mav_tasks.links.memory import Radio
from tests.kit import px4
from tests.kit.client import ARM, AUTO, PAUSE_CONTINUE, FakeClient, setpoint, sticks
from tests.kit.soak.deeds import Deed, Stage
from tests.kit.soak.words import MISSION_START, RELEASE, Kind, Said
from tests.kit.soak.world import SoakWorld

REPEATED = 2.0  # s, within which a stock client repeats, unmarked, an unanswered request
LATE = 20.0  # s, the oldest request that is copied
FREEZES = (0.6, 0.6, 2.0, 5.0, 20.0)  # s
SUSPENSIONS = (2.0, 5.0, 20.0)  # s
APART = (0.005, 0.02, 0.2)  # s, between two requests, the second of which overtakes the first
AFTER = (0.3, 1.0, 3.0, 8.0)  # s, until a copy comes
COMMANDS = ("COMMAND_LONG", "COMMAND_INT")
COPIED = (Kind.GO, Kind.WISH, Kind.MOTION)


def radio(world: SoakWorld, *, bytes_per_second: float, buffer: int) -> None:
    """Put a radio with a buffer between the server and each rover, in both directions."""
    for number in range(1, len(world.rovers) + 1):
        for way in ((f"rover{number}", VEHICLE_LINK), (VEHICLE_LINK, f"rover{number}")):
            world.net.buffers[way] = Radio(bytes_per_second=bytes_per_second, buffer=buffer)


class Attacks:
    """The attacks on a world, besides its people's actions."""

    def __init__(self, world: SoakWorld, stage: Stage) -> None:
        self._world = world
        self._stage = stage
        self._random: Random = stage.random
        self._ways = world.observers[0].ways
        self._auto = px4.MISSION if self._ways.sub_modes else AUTO

    def deeds(self) -> list[Deed]:
        """Return the attacks; repeated ones are more frequent."""
        return [
            *[self.copy] * 6,
            *[self.late_copy_of_a_go] * 3,
            *[self.overtaken] * 2,
            self.freeze,
            self.suspend,
            self.lay_radio,
            self.end_on_full_disk,
        ]

    def copy(self) -> None:
        """Repeat a client's earlier request."""
        now = self._world.now
        told = [
            s for s in self._world.words.recent if s.kind in COPIED and now - s.first.at <= LATE
        ]
        if told:
            self._again(self._random.choice(told))

    def late_copy_of_a_go(self) -> None:
        """Send a go request, then a newer halt, then a copy of the older go request."""
        world, random = self._world, self._random
        client, number = self._stage.client(), self._stage.rover()
        self._go(client, number)
        word = world.words.recent[-1]
        world.run(random.choice(AFTER))
        self._halt(self._stage.client(), number)
        world.run(random.choice(AFTER))
        self._again(word)

    def overtaken(self) -> None:
        """Send two requests of one client; the second arrives first."""
        client, number = self._stage.client(), self._stage.rover()
        self._note("overtaken words")
        self._world.swap_next_two(client)
        self._go(client, number)
        self._world.run(self._random.choice(APART))
        self._halt(client, number)

    def freeze(self) -> None:
        """Freeze the server's process; packets sent meanwhile wait in its sockets."""
        self._note("server frozen")
        self._world.freeze(self._random.choice(FREEZES), self._meanwhile)

    def suspend(self) -> None:
        """Suspend the server's machine, and with it the clock of its uptime."""
        self._note("machine suspended")
        self._world.suspend_machine(self._random.choice(SUSPENSIONS), self._meanwhile)

    def lay_radio(self) -> None:
        """Put a slow radio with a large buffer between server and rovers, or remove it."""
        if self._world.net.buffers:
            self._world.net.buffers.clear()
        else:
            radio(self._world, bytes_per_second=5_760.0, buffer=16_384)
            self._note("radio with a buffer")

    def end_on_full_disk(self) -> None:
        """Fill the disk, halt the rover, and end the server by SIGTERM."""
        self._note("ended on a full disk")
        world, number = self._world, self._stage.rover()
        world.disk_store.break_for(5.0)
        self._halt(self._stage.client(), number)
        world.run(self._random.choice(AFTER))
        world.restart_in_order(away=self._random.choice((0.5, 8.0)))
        self._stage.store = world.disk_store

    def _meanwhile(self) -> None:
        """Let a client act while the server is stopped."""
        client, number = self._stage.client(), self._stage.rover()
        self._random.choice(
            (
                lambda: self._go(client, number),
                lambda: self._halt(client, number),
                lambda: client.move(
                    0.5, nonce=self._random.randrange(1, 1 << 24), target=(number, 191)
                ),
                lambda: client.send(sticks(300, system=number)),
                lambda: client.send(setpoint(0.3, system=number)),
            )
        )()

    def _note(self, name: str) -> None:
        self._world.deeds[name] += 1

    def _again(self, said: Said) -> None:
        """Repeat a request: the same packet, or as its sender would repeat it."""
        ways = ["the same packet", "confirmed higher"]
        if self._world.now - said.first.at <= REPEATED and not self._is_over(said):
            ways.append("with a new number")  # later, no client sends it by itself
        how = self._random.choice(ways)
        name = f"copy of {said.name}: {how}"
        if how == "the same packet" or said.message.get_type() not in COMMANDS:
            self._note(name if how == "the same packet" else f"copy of {said.name}: again")
            self._world.net.send(said.client.name, said.client.server, said.data)
            return
        if how == "confirmed higher" and said.message.get_type() == "COMMAND_INT":
            self._world.net.send(said.client.name, said.client.server, said.data)  # no confirmation
            return
        if how == "confirmed higher":
            higher = common.MAVLink_command_long_message(
                *_fields(said.message, confirmation=self._random.randint(1, 10))
            )
        else:
            higher, name = said.message, f"copy of {said.name}: with a new number"
        self._note(name)
        self._world.repeat(said, higher)

    def _is_over(self, said: Said) -> bool:
        """Return whether its client has sent a halt by the same command since: no repeats."""
        return any(
            later.kind is Kind.HALT
            and later.client is said.client
            and later.first.order > said.first.order
            and later.message.command == getattr(said.message, "command", 0)
            for later in self._world.words.recent
        )

    def _ask_mode(self, client: FakeClient, number: int, mode: int) -> None:
        if self._ways.sub_modes:
            px4.ask_mode(client, mode, target=(number, 1))
        else:
            client.mode(mode, target=(number, 1))

    def _go(self, client: FakeClient, number: int) -> None:
        own, rover = (number, 191), (number, 1)
        self._random.choice(
            (
                lambda: client.proceed(target=own),
                lambda: client.proceed(target=own),
                lambda: client.command(PAUSE_CONTINUE, 1, target=rover),
                lambda: client.command(RELEASE, 0, self._random.randrange(3), target=own),
                lambda: client.command(MISSION_START, target=rover),
                lambda: self._ask_mode(client, number, self._auto),
                lambda: client.command(ARM, 1, target=rover),
            )
        )()

    def _halt(self, client: FakeClient, number: int) -> None:
        own, rover = (number, 191), (number, 1)
        self._random.choice(
            (
                lambda: client.stop(target=own),
                lambda: client.pause(target=own),
                lambda: self._ask_mode(client, number, self._ways.hold),
                lambda: client.arm(False, target=rover),
            )
        )()


def _fields(message: common.MAVLink_message, *, confirmation: int) -> list[float]:
    values = {name: getattr(message, name) for name in message.fieldnames}
    values["confirmation"] = confirmation
    return list(values.values())
