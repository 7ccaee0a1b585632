"""The published table of messages × role × state: does the rover get what it says, and no more?

Rows of what the server handles itself are shown by ``test_roles.py``.
"""

import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import pytest
from pymavlink.dialects.v20 import ardupilotmega, common

from generators.documents import full_policy
from mav_tasks.config.settings import ROLES, Clients, Limits, Roles, Settings
from mav_tasks.mavlink import messages as m
from mav_tasks.shell.in_memory import VEHICLE_LINK
from mav_tasks.tasks.lifecycle import TaskState
from rover_sim.personas import Mode
from tests.kit.client import GUIDED, FakeClient, command_long
from tests.kit.world import COMMAND_ID, INT_COMMAND, MODE_COMMAND, World
from tests.scenarios.conftest import MakeWorld

COMMANDS_OF_NOBODY, SET_MODE, NO_MODE = (99, 65000), 176, 104
FILE_TRANSFER = 110  # what it asks for counts: zeros only read
SEEN = 0.03  # s, in which what is sent is seen to, and answered by the rover
#: what each column "forwarded" needs besides the role: the states in which it passes
PASSES: dict[str, tuple[str, ...]] = {
    "always": ("idle", "task", "STOP", "granted"),
    "not during STOP": ("idle", "task", "granted"),
    "not during STOP or a task": ("idle", "granted"),
    "only in control": ("granted",),
}


class Word(NamedTuple):
    """One number of the table."""

    number: int
    is_command: bool
    role: str
    forwarded: str


def tables() -> tuple[str, str]:
    """Return what the table has about commands, and about messages."""
    policy = full_policy()
    return "\n".join(policy["commands"]), "\n".join(policy["messages"])


def words() -> Iterator[Word]:
    """Yield what the table has about words that the server itself does not handle."""
    commands, messages = tables()
    for part, is_command in ((commands, True), (messages, False)):
        for line in part.splitlines():
            cells = [cell.strip() for cell in line.strip("|").split("|")]
            if len(cells) < 5 or cells[3] not in PASSES:
                continue
            numbers = [int(each) for each in re.findall(r"(?:^|, )(\d+) ", cells[4])]
            if cells[4] == "all others" and is_command:
                numbers = list(COMMANDS_OF_NOBODY)
            role = cells[1].partition(",")[0]
            for number in numbers:
                if is_command or (number in common.mavlink_map and number != FILE_TRANSFER):
                    yield Word(number, is_command, role, cells[3])


def said(client: FakeClient, word: Word) -> bytes:
    """Return a word as a client sends it to the autopilot: mostly zeros."""
    if word.is_command:
        mode = NO_MODE if word.number == SET_MODE else 0
        return client.send_repeated(command_long(word.number, 1, mode, target=(1, 1)))
    cls = common.mavlink_map[word.number]
    values: list[Any] = []
    for name in cls.fieldnames:
        place = cls.ordered_fieldnames.index(name)
        length = cls.array_lengths[place]
        is_text = cls.fieldtypes[cls.fieldnames.index(name)] == "char"
        values.append((b"" if is_text else [0] * length) if length else int(name in TARGETS))
    return client.send_repeated(cls(*values))


TARGETS = ("target", "target_system", "target_component")


def enter(world: World, state: str, driver: FakeClient) -> None:
    """Bring the rover into a state of control."""
    if state == "task":
        world.client.move(900.0, speed=0.5)
        world.until_state(1, TaskState.EXECUTING)
    elif state != "idle":
        world.operator_mode(Mode.HOLD)
        world.operator_arm(True)
        world.run(1.2)
        _ = driver.mode(GUIDED) if state == "granted" else world.client.stop()
    world.run(2.0)


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize("state", ["idle", "task", "STOP", "granted"])
def test_what_reaches_the_rover_is_what_the_table_says(make_world: MakeWorld, state: str) -> None:
    system_ids = {role: 20 + index for index, role in enumerate(ROLES)}
    limits = {role: Limits(rate=1e6) for role in ROLES}
    addresses = {f"{number}/190": role for role, number in system_ids.items()}
    settings = Settings(
        roles=Roles(unsigned="safety", addresses=addresses, **limits),
        clients=Clients(packet_rate=1e6),
    )
    all_words, wrong = list(words()), list[str]()
    assert len(all_words) > 250
    for role, system_id in system_ids.items():
        may_drive = role in ("operator", "safety")
        world = client = None
        passed: set[tuple[bool, int]] = set()

        def look(sender: str, _target: str, data: bytes) -> bool:
            if sender == VEHICLE_LINK and data[5] == system_id:  # noqa: B023
                is_command = data[7] in (INT_COMMAND, MODE_COMMAND) and not data[8]
                place = COMMAND_ID if is_command else slice(7, 10)
                passed.add((is_command, int.from_bytes(data[place], "little")))  # noqa: B023
            return False

        for word in all_words:
            if world is None or client is None:
                world = make_world(settings=settings)
                client = world.add_client(role, system_id=system_id)
                client.reads_dialect = client.heartbeats = False
                client.send(common.MAVLink_ping_message(0, 0, 1, 1))
                world.run(0.1)
                enter(world, state, client if may_drive else world.client)
                world.watched.loses = look
            before = world.rover.autopilot.armed, world.rover.autopilot.mode, world.paused()
            passed.clear()
            client.send_raw(said(client, word))
            world.run(SEEN)
            has_role = ROLES.index(role) >= ROLES.index(word.role)
            passes = has_role and state in PASSES[word.forwarded]
            passes &= word.forwarded != "only in control" or may_drive
            wanted = {(word.is_command, word.number)} if passes else set()
            if passed != wanted:
                wrong.append(f"{word} by {role}: {passed or 'nothing'} reaches the rover")
            after = world.rover.autopilot.armed, world.rover.autopilot.mode, world.paused()
            if after != before:
                world = None
                if not passes:
                    wrong.append(f"{word} by {role}: {before} becomes {after}")
    assert wrong == []


ENVELOPES = (75, 76)  # COMMAND_INT and COMMAND_LONG are judged by the command in them


def test_each_message_and_command_of_mavlink_is_judged_by_name() -> None:
    commands, messages = (
        {int(number): name for number, name in re.findall(r"\b(\d+) ([A-Z]\w+)", part)}
        for part in tables()
    )
    entries = ardupilotmega.enums["MAV_CMD"].items()
    wanted = {number: entry.name.removeprefix("MAV_CMD_") for number, entry in entries}
    wanted = {number: name for number, name in wanted.items() if name != "ENUM_END"}
    assert {number: commands.get(number) for number in wanted} == wanted
    wanted = {number: kind.msgname for number, kind in m.ALL.items() if number not in ENVELOPES}
    assert {number: messages.get(number) for number in wanted} == wanted


def test_what_moves_a_rover_is_for_no_observer_and_nobody_s_at_any_time() -> None:
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in "\n".join(tables()).splitlines()
        if line.startswith(("| go", "| motion", "| manual", "| action"))
    ]
    assert len(rows) > 20
    assert [row for row in rows if row[1] == "observer" or row[3] == "always"] == []
