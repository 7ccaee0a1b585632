"""Every message and command × role × state of control: does the rover get what the table says?

The words go to the rover itself, to another component of it, and to the server. What reaches the
rover's link is compared with the row, and so is what becomes of the rover, in truth.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from math import nan
from typing import Any, NamedTuple

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.engine.commands.motion_gate import why_no_motion
from mav_tasks.engine.policy import DISARM, PAUSE, PAUSE_HERE, Kind, Row, row_of, row_of_command
from mav_tasks.engine.policy.commands import COMMANDS, HOLD, START
from mav_tasks.engine.policy.messages import MESSAGES
from mav_tasks.in_memory import VEHICLE_LINK
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.codec import Decoder
from mav_tasks.mavlink.packet import split_datagram
from mav_tasks.settings import ROLES, Clients, Limits, Roles, Settings
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Mode
from tests.kit.client import GUIDED, FakeClient, command_long
from tests.kit.volume import some
from tests.kit.world import COMMAND_ID, INT_COMMAND, MODE_COMMAND, World
from tests.scenarios.conftest import MakeWorld

SYSTEM_IDS = {role: 20 + each for each, role in enumerate(ROLES)}
NO_SUCH_COMPONENT = 99  # an autopilot does what that is told
SEEN = 0.03  # s, in which what is sent is seen to, and answered by the rover
FOLLOWS = 0.6  # s, in which what is taken in would arm a rover, or change its mode
DO_SET_MODE, REPOSITION, PAUSE_CONTINUE, ARM = 176, 192, 193, 400
RETURN, HOLD_MODE = 11, 4
COMMANDS_OF_NOBODY = (99, 65000)
#: the server sees to these also where they name a component that is not there
OURS_EVERYWHERE = (54003, 510, 511)  # STOP, and what one client is shown
IDS_OF_NOBODY = (0x7777, 0xABCDE)


class Word(NamedTuple):
    """What a client says."""

    row: Row
    number: int
    is_command: bool
    raw: Callable[[FakeClient], bytes]
    component: int = 1

    def __str__(self) -> str:
        what = "command" if self.is_command else "message"
        return f"{what} {self.number} {self.row.name} to component {self.component}"

    @property
    def is_ours(self) -> bool:
        """Whether the server sees to it itself."""
        return self.row.is_claimed and self.component != NO_SUCH_COMPONENT


def command(row: Row, number: int, *params: float, component: int = 1) -> Word:
    message = command_long(number, *params, target=(1, component))
    return Word(row, number, True, lambda client: client.send_repeated(message), component)


def commands() -> Iterator[Word]:
    for number in (*COMMANDS, *COMMANDS_OF_NOBODY, 54020):
        row = row_of_command(number)
        second = 0 if number in (DO_SET_MODE, REPOSITION, PAUSE_CONTINUE) else 1
        if row.kind is not Kind.HALT or number >= 54000:
            yield command(row, number, 1, second)
            if number not in OURS_EVERYWHERE:
                yield command(row, number, 1, second, component=NO_SUCH_COMPONENT)
    yield command(DISARM, ARM, 0)
    yield command(PAUSE, PAUSE_CONTINUE, 0)
    yield command(PAUSE_HERE, REPOSITION, -1, 1, 0, nan, nan, nan, nan)
    yield command(HOLD, DO_SET_MODE, 1, HOLD_MODE)
    yield command(START, DO_SET_MODE, 1, RETURN)


def message_of(cls: Any) -> Any:
    """Return a message of zeros for the first rover; plain pymavlink, none of ours."""
    values: list[Any] = []
    for name in cls.fieldnames:
        place = cls.ordered_fieldnames.index(name)
        length = cls.array_lengths[place]
        is_text = cls.fieldtypes[cls.fieldnames.index(name)] == "char"
        values.append((b"" if is_text else [0] * length) if length else 0)
    message = cls(*values)
    for name in ("target", "target_system", "target_component"):
        if name in cls.fieldnames:
            setattr(message, name, 1)
    return message


def messages() -> Iterator[Word]:
    decoder = Decoder()
    sender = common.MAVLink(None, 255, 190)
    for number, cls in m.ALL.items():
        if number in (m.CommandLong.id, m.CommandInt.id):
            continue
        message = message_of(cls)
        (packet,) = split_datagram(message.pack(sender))
        row = row_of(number, decoder.decode(packet))
        yield Word(row, number, False, verified(message))
    for number in {*MESSAGES, *IDS_OF_NOBODY} - set(m.ALL):
        yield Word(row_of(number, None), number, False, unverified(number))


def verified(message: Any) -> Callable[[FakeClient], bytes]:
    return lambda client: client.send_repeated(message)


def unverified(number: int) -> Callable[[FakeClient], bytes]:
    def raw(client: FakeClient) -> bytes:
        head = bytes((0xFD, 20, 0, 0, 1, client.system_id, client.component_id))
        return head + number.to_bytes(3, "little") + b"\1" * 22

    return raw


# states of control


def idle(_walk: "Walk") -> None:
    """Disarmed, and nothing to do."""


def armed_in_hold(walk: "Walk") -> None:
    walk.world.operator_mode(Mode.HOLD)
    walk.world.operator_arm(True)
    walk.world.run(1.2)


def task_drives(walk: "Walk") -> None:
    walk.world.client.move(900.0, speed=0.5)
    walk.world.until_state(1, S.EXECUTING)
    walk.world.run(1.0)


def paused(walk: "Walk") -> None:
    task_drives(walk)
    walk.world.client.pause()
    walk.world.until(lambda: walk.world.control() == "IDLE", within=8)


def stopped(walk: "Walk") -> None:
    armed_in_hold(walk)
    walk.world.client.stop()
    walk.world.until(lambda: walk.world.control() == "IDLE", within=8)


def granted(walk: "Walk") -> None:
    """The client itself drives by set-points; who may not is beside one who does."""
    armed_in_hold(walk)
    driver = walk.client if walk.role in ("operator", "safety") else walk.world.client
    driver.mode(GUIDED)
    walk.world.run(1.0)
    assert walk.vehicle.parts.authority.has_granted((driver.server, driver.name)), "it was granted"


STATES = (idle, armed_in_hold, task_drives, paused, stopped, granted)


@dataclass
class Walk:
    """One role in one state."""

    make_world: MakeWorld
    role: str
    enter: Callable[["Walk"], None]
    world: World = field(init=False)
    client: FakeClient = field(init=False)
    passed: set[tuple[bool, int]] = field(default_factory=set)
    walked: int = 0
    worlds: int = 0

    def __post_init__(self) -> None:
        self.begin()

    @property
    def vehicle(self) -> Any:
        """The server's own view of the rover."""
        return self.world.server.engine._vehicles.look_at(1)

    def begin(self) -> None:
        """Enter the state in a world of its own."""
        roles = {f"{SYSTEM_IDS[role]}/190": role for role in ROLES}
        limits = {role: Limits(rate=1e6) for role in ROLES}
        settings = Settings(
            roles=Roles(unsigned="safety", addresses=roles, **limits),
            clients=Clients(packet_rate=1e6),
        )
        self.world = self.make_world(settings=settings)
        self.client = self.world.add_client(self.role, system_id=SYSTEM_IDS[self.role])
        self.client.reads_dialect = self.client.heartbeats = False
        self.client.send(common.MAVLink_ping_message(0, 0, 1, 1))
        self.world.run(0.1)
        self.enter(self)
        self.world.run(2.0)
        self.world.watched.loses = self._look
        self.worlds += 1

    def _look(self, sender: str, _target: str, data: bytes) -> bool:
        if sender == VEHICLE_LINK and (data[5], data[6]) == (self.client.system_id, 190):
            number = int.from_bytes(data[7:10], "little")
            is_command = number in (INT_COMMAND, MODE_COMMAND)
            if is_command:
                number = int.from_bytes(data[COMMAND_ID], "little")
            self.passed.add((is_command, number))
        return False

    def state(self) -> tuple[object, ...]:
        """Return what is to be the same again."""
        autopilot, tasks = self.world.rover.autopilot, self.vehicle.tasks
        active = tasks.active
        return (
            autopilot.armed,
            autopilot.mode,
            self.world.paused(),
            self.world.control(),
            None if active is None else (active.id, active.state),
            len(tuple(tasks.waiting)),
            self.vehicle.parts.authority.has_granted((self.client.server, self.client.name)),
            self.vehicle.parts.authority.has_granted((self.client.server, self.world.client.name)),
            why_no_motion(self.vehicle.parts),
        )

    def say(self, word: Word) -> None:
        """Say it, and compare what becomes of it with its row."""
        self.walked += 1
        before = self.state()
        self.passed.clear()
        self.client.acks.clear()
        self.client.send_raw(word.raw(self.client))
        self.world.run(SEEN)
        where = f"{word} by {self.role} in {self.enter.__name__}: {word.row.passed_on}"
        assert ((word.is_command, word.number) in self.passed) is self.may_pass(word), where
        assert self.passed <= {(word.is_command, word.number)}, where
        if not self.may(word.row if word.is_ours else word.row.passed_on):
            assert self.state() == before, where
        elif self.state() != before:
            self.world.run(FOLLOWS)
            self.check(word, before, where)
            self.begin()

    def may(self, row: Row) -> bool:
        """Whether the role is enough for a row."""
        return ROLES.index(self.role) >= ROLES.index(row.role)

    def may_pass(self, word: Word) -> bool:
        """Whether a word is to reach the rover, by its row."""
        row = word.row
        if word.is_ours and row.kind is not Kind.QUESTION:
            return False
        if word.is_ours and word.number not in ASKED_OF_THE_ROVER:
            return False
        row = row.passed_on
        if not self.may(row):
            return False
        if self.enter is stopped and not row.passes_under_stop:
            return False
        if self.enter is task_drives and not row.passes_beside_task:
            return False
        return not row.needs_grant or (
            self.enter is granted and self.role in ("operator", "safety")
        )

    def check(self, word: Word, before: tuple[object, ...], where: str) -> None:
        """Compare what has changed with the kind of the word."""
        kind = word.row.kind if word.is_ours else word.row.passed_on.kind
        armed, mode, *_ = before
        autopilot = self.world.rover.autopilot
        changes = [pair for pair in zip(before, self.state(), strict=True) if pair[0] != pair[1]]
        assert kind not in (Kind.QUESTION, Kind.TELL), f"changes {changes}: {where}"
        if self.enter in (paused, stopped) and kind in (Kind.WISH, Kind.HALT, Kind.ACTION):
            assert (autopilot.armed or armed) == armed, where
            assert autopilot.mode in (mode, Mode.HOLD), where
            assert self.world.stands(), where
        if self.enter is stopped and not (kind is Kind.GO and self.role in ("operator", "safety")):
            assert self.world.paused() is R.STOPPED, where
        if kind is Kind.HALT and self.enter is task_drives and word.number != 54011:
            active = self.vehicle.tasks.active
            assert active is None or active.state is not S.EXECUTING, where


ASKED_OF_THE_ROVER = (512,)  # REQUEST_MESSAGE of what the server does not know itself


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize("state", some(STATES, 2, 4, 5), ids=lambda state: state.__name__)
def test_what_reaches_the_rover_and_what_it_does_is_what_the_table_says(
    make_world: MakeWorld, state: Callable[[Walk], None]
) -> None:
    words = [*commands(), *messages()]
    walked = worlds = 0
    for role in ROLES:
        walk = Walk(make_world, role, state)
        for word in words:
            walk.say(word)
        walked, worlds = walked + walk.walked, worlds + walk.worlds
    print(f"{walked} combinations in {state.__name__}, in {worlds} worlds")
    assert walked == len(words) * len(ROLES)
