"""Events of a world: clients' actions, actions of a person at the rover, failures.

An event that is listed more often happens more often.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import nan
from random import Random
from typing import Any

from pymavlink.dialects.v20 import common

from rover_sim.faults import Faults
from rover_sim.personas import Mode
from tests.kit import px4
from tests.kit.client import (
    AUTO,
    GUIDED,
    HOLD,
    MANUAL,
    RTL,
    FakeClient,
    set_mode,
    setpoint,
    sticks,
)
from tests.kit.mission import Item, Upload
from tests.kit.store import LateStore
from tests.kit.world import World, at

Deed = Callable[[], object]

MODES = (MANUAL, HOLD, AUTO, RTL, GUIDED)
PX4_MODES = (px4.MANUAL, px4.HOLD, px4.MISSION, px4.RETURN, px4.OFFBOARD)
#: name and value of each rover fault
FAULTS = (
    ("rover silent", Faults(silent=True)),
    ("rover deaf", Faults(deaf=True)),
    ("rover silent and deaf", Faults(silent=True, deaf=True)),
    ("position frozen", Faults(position_frozen=True)),
    ("position jumps", Faults(position_jump=(3.0, 0.0))),
    ("arming refused", Faults(refuse_arm=True)),
    ("mode refused", Faults(refuse_mode=True)),
    ("no heartbeats", Faults(withheld=frozenset({0}))),
    ("no positions", Faults(withheld=frozenset({32}))),
)


@dataclass
class Stage:
    """A world with its actors; only the random source decides."""

    world: World
    random: Random
    store: LateStore
    clients: Sequence[FakeClient]
    #: called with the name of each fault
    note: Callable[[str], None] = lambda _: None

    def client(self) -> FakeClient:
        """Return one of the clients."""
        return self.random.choice(self.clients)

    def rover(self) -> int:
        """Return the system id of one of the rovers."""
        count = len(self.world.rovers)
        return 1 if count == 1 else self.random.randint(1, count)

    def person_turns(self, number: int, mode: Mode) -> None:
        """Let a person turn the mode switch at a rover."""
        self.world.rovers[number - 1].autopilot.operator_mode(mode, now=self.world.now)

    def person_arms(self, number: int, armed: bool) -> None:
        """Let a person arm or disarm a rover."""
        self.world.rovers[number - 1].autopilot.operator_arm(armed, now=self.world.now)

    def place(self) -> dict[str, Any]:
        """Return a random place within a few metres of the first rover's start."""
        return at(self.random.uniform(-3, 3), self.random.uniform(-3, 3))


def deeds(stage: Stage) -> list[Deed]:
    """Return the events for an ArduPilot rover, which apply to any other, too."""
    random, client, rover = stage.random, stage.client, stage.rover

    def submit() -> None:
        for _ in range(3):
            client().move(
                random.choice((-1.0, 0.5, 2.0)),
                nonce=random.randrange(1, 1 << 24),
                target=(rover(), 191),
            )

    return [
        submit,
        submit,
        lambda: client().rotate(random.uniform(-90, 90), target=(rover(), 191)),
        lambda: client().proceed(target=(rover(), 191)),
        lambda: client().proceed(target=(rover(), 191)),
        lambda: client().proceed(target=(rover(), 191)),
        lambda: client().pause(target=(rover(), 191)),
        lambda: client().stop(clear=random.random() < 0.5, target=(rover(), 191)),
        lambda: client().mode(random.choice(MODES), target=(rover(), 1)),
        lambda: client().mode(HOLD, target=(rover(), 1)),
        lambda: client().arm(random.random() < 0.5, target=(rover(), 1)),
        lambda: client().send(sticks(random.choice((0, 300)), system=rover())),
        lambda: client().send(setpoint(0.3, system=rover())),
        *at_the_rover(stage),
        *breaks(stage),
    ]


def at_the_rover(stage: Stage) -> list[Deed]:
    """Return the actions of a person at a rover."""
    random = stage.random

    def turn_switch() -> None:
        mode = random.choice((Mode.HOLD, Mode.HOLD, *Mode))
        stage.person_turns(stage.rover(), mode)

    def arm() -> None:
        armed = random.random() < 0.7
        stage.person_arms(stage.rover(), armed)

    return [turn_switch, arm]


def breaks(stage: Stage) -> list[Deed]:
    """Return the failures of rover, server machine and disk."""
    world, random = stage.world, stage.random

    def break_rover() -> None:
        name, faults = random.choice(FAULTS)
        stage.note(name)
        world.rovers[stage.rover() - 1].autopilot.set_faults(faults)

    def mend_rover() -> None:
        world.rovers[stage.rover() - 1].autopilot.set_faults(Faults())

    def reboot() -> None:
        stage.note("rover reboots")
        world.rovers[stage.rover() - 1].autopilot.reboot(now=world.now)

    def starve() -> None:
        stage.note("server starved")
        world.suspend_server(random.choice((0.05, 0.4, 0.8)))

    def slow_disk() -> None:
        delay = random.choice((0.0, 0.0, 0.1, 2.0))
        stage.note("disk slow" if delay else "disk fast again")
        stage.store.delay = delay

    return [break_rover, mend_rover, mend_rover, reboot, starve, slow_disk]


def px4_deeds(stage: Stage) -> list[Deed]:
    """Return the events for a rover that speaks like PX4: the common ones and more."""
    world, random, client, rover = stage.world, stage.random, stage.client, stage.rover
    other = world.net.link("other station")

    def go_to() -> None:
        sender, number = client(), rover()
        if random.random() < 0.5:
            px4.ask_mode(sender, px4.HOLD, target=(number, 1))
        sender.command_int(
            px4.REPOSITION, -1, 1, 0, nan, **stage.place(), frame=6, target=(number, 1)
        )

    def go_to_by_another_station() -> None:
        stage.note("another station drives")
        number = rover()
        message = common.MAVLink_command_int_message(
            *(number, 1, 6, px4.REPOSITION, 0, 0, -1, 1, 0, nan), *stage.place().values(), 0
        )
        other.send(f"rover{number}", message.pack(common.MAVLink(None, 255, 190)))

    def end_streams() -> None:
        for each in stage.clients:
            each.end_streams()

    def ask(mode: int) -> None:
        px4.ask_mode(client(), mode, target=(rover(), 1))

    return [
        *deeds(stage),
        go_to,
        go_to,
        go_to_by_another_station,
        lambda: upload(stage, component=1),
        lambda: ask(random.choice(PX4_MODES)),
        partial(ask, px4.HOLD),
        partial(ask, px4.MISSION),
        partial(ask, px4.OFFBOARD),
        lambda: client().send(set_mode(random.choice(PX4_MODES), system=rover())),
        lambda: client().stream(setpoint(0.3, system=rover()), rate=20),
        end_streams,
    ]


def upload(stage: Stage, *, component: int) -> None:
    """Let a client upload a plan of two places."""
    items = [Item(16, **stage.place()), Item(16, **stage.place())]
    Upload(stage.client(), items, target=(stage.rover(), component))
