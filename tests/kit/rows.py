"""Stories as the rows of a text: requests, each with its answer, and what has become of them.

A row is a request, " : ", the result in its ack ("-": it gets none), and what is with it: words in
the texts that come, and the number in the ack ("#1"), with " / " between them. A request is a
command, a mission message, or a plan with its items; " & " joins some. "name> " before it is who
sends it, if that is not the world's own client.

Words are also those of ``facts``, 0.4 s after a request, or as soon as the waiting is over that a
row ends with; "at=1,2,90" is the rover's true pose, in metres and degrees; "!" before words: they
must not be there.
"""

import re
from typing import Any

from pymavlink.dialects.v20 import common

from mav_tasks.mavlink.enums import MavCmd, MavMissionResult, MavResult
from mav_tasks.shell.in_memory import CLIENT_LINK, VEHICLE_LINK
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from rover_sim.faults import Faults
from rover_sim.personas import Mode
from tests.kit.client import IDS, TASK_STATUS, FakeClient, TaskStatus
from tests.kit.mission import Item, Upload, acks
from tests.kit.world import World, at, near_pose

PLACES = {
    "autopilot": (1, 1),
    "server": (1, 191),
    "all": (0, 0),
    "rover": (1, 0),
    "unknown": (1, 99),
    "any": (250, 191),
    "other": (250, 5),
    "second": (2, 191),
    "camera": (1, 100),
}
KINDS = {"plan": 0, "mission": 0, "fence": 1, "rally": 2}
SHORT = {
    "GO": "NAV_WAYPOINT",
    "KEY": ",".join(["0"] * 32),
    "ZEROS": ",".join(["0"] * 247),
    "ARM": "COMPONENT_ARM_DISARM to=autopilot",
    "BLIND": "fault withheld=30,32",
    "CLICK": "DO_REPOSITION -1 1 0 nan to=autopilot",
    "HOLD": "DO_SET_MODE 1 4 3 to=autopilot",
    "LONG": "Failsafe" + "x" * 42,
    "LONGER": "Failsafe" + "x" * 41 + "y",
    "MANY_TEXTS": " & ".join(f"rover:statustext 6 x{n:049} {n % 40 + 1} 0" for n in range(80)),
    "CONTINUE": "DO_PAUSE_CONTINUE 1",
    "EIGHT": "0,0,0,0,0,0,0,0",
    "BUSY": "TEMPORARILY_REJECTED",
    "IN": "NAV_FENCE_POLYGON_VERTEX_INCLUSION",
    "SHOW": "REQUEST_MESSAGE 54000",
    "NOT_ALLOWED": "DENIED #108",
    "PAUSE": "DO_PAUSE_CONTINUE 0",
    "POND": "NAV_FENCE_POLYGON_VERTEX_EXCLUSION",
}
WAITS = ("wait", "until", "idle", "faster")
PARAMETERS = IDS["PARAM_VALUE"], IDS["PARAM_ERROR"]


def number(word: str) -> Any:
    if "," in word:
        return tuple(map(number, word.split(",")))
    try:
        return int(word) if word.lstrip("-").isdigit() else float(word)
    except ValueError:
        return word.encode()


def parsed(text: str) -> tuple[str, list[Any], dict[str, Any]]:
    """Return the first word, the numbers and the fields after it; ``at`` is a place in metres."""
    name, *words = text.split()
    fields: dict[str, Any] = dict(word.split("=") for word in words if "=" in word)
    place = at(*number(fields.pop("at"))) if "at" in fields else {}
    fields = {key: PLACES.get(word) or number(word) for key, word in fields.items()}
    return name, [number(word) for word in words if "=" not in word], fields | place


def item(text: str) -> Item:
    name, params, fields = parsed(text)
    return Item(number_of(name), 0, 0, *params)._replace(**fields)


def ask(world: World, text: str, client: FakeClient | None = None) -> None:
    """Send a request, or do what else a row begins with."""
    first, *items = text.split(";")
    name, numbers, fields = parsed(first)
    client = client or world.client
    is_of_server = name == "plan" or name.isupper()
    target = fields.pop("to", PLACES["server" if is_of_server else "autopilot"])
    if name == "wait":
        world.run(numbers[0])
    elif name == "until":
        task, state = numbers
        world.until_state(task, TaskState[state.decode()], within=fields.get("within", 30))
    elif name == "idle":
        world.until_idle(tasks=numbers[0], within=fields.get("within", 60))
    elif name == "faster":
        world.until_faster(*numbers)
    elif name == "fault":
        world.fault(Faults(**fields))
    elif name == "lose":
        world.watched.loses = lambda source, _, data: source == "rover1" and data[7] == numbers[0]
    elif name == "again":
        client.send_raw(client.last_command)
    elif name == "sleep":
        world.suspend_server(numbers[0])
    elif name == "reboot":
        world.rover.autopilot.reboot(now=world.now)
    elif name == "operator" and numbers[0] in (b"arms", b"disarms"):
        world.operator_arm(numbers[0] == b"arms")
    elif name == "operator":
        world.operator_mode(Mode(numbers[0].decode()))
    elif name == "unread":
        world.watched.unread_links[CLIENT_LINK] = []
    elif name == "read":
        world.watched.read_again(CLIENT_LINK)
    elif name in KINDS:
        Upload(client, [item(each) for each in items], kind=KINDS[name], target=target)
    elif ":" in name:
        who, _, name = name.partition(":")
        message = getattr(common, f"MAVLink_{name}_message")(*numbers)
        if who == "rover":
            world.net.send("rover1", VEHICLE_LINK, message.pack(common.MAVLink(None, 1, 1)))
        else:
            client.send(message)
    elif name.islower():
        client.send(getattr(common, f"MAVLink_{name}_message")(*target, *numbers))
    elif fields.keys() & {"x", "frame"}:
        client.command_int(number_of(name), *numbers, target=target, **fields)
    else:
        client.command(number_of(name), *numbers, target=target, **fields)


def number_of(name: str) -> int:
    """Return the number of a command, as in the standard or in our dialect."""
    of_standard = getattr(common, f"MAV_CMD_{name}", None)
    return int(name if name.isdigit() else of_standard or MavCmd[name])


def facts(world: World, since: float) -> list[str]:
    """Return what is so now, and what has left for the rover since then, in words."""
    if not world.server.engine.snapshot(now=world.now).vehicles:
        return []
    sent = dict.fromkeys(world.observer.sent_since(since))
    return [
        *(f"task {t.id}: {t.state.name} {t.reason.name}." for t in world.tasks()),
        f"queue {world.paused().name}, mode {world.mode().value}, it is {world.control()}",
        f"it is {'ARMED' if world.is_armed else 'DISARMED'}",
        f"it {'STANDS' if world.stands() else 'MOVES'}",
        f"it gets {' '.join(sent).lower() or 'nothing'}.",
    ]


def is_told(world: World, words: str, numbers: list[str], said: str) -> bool:
    """Return whether words are among the numbers, the texts or the facts, or are the pose."""
    if words.startswith("at="):
        return near_pose(world.pose(), number(words[3:]))
    if words.startswith("!"):
        return not is_told(world, words[1:], numbers, said)
    return words in (numbers if words[:1] == "#" else said)


def check(world: World, table: str, **clients: FakeClient) -> None:
    """Send requests one by one, and compare the answers to each."""
    table = re.sub(r"\w+", lambda word: SHORT.get(word[0], word[0]), table)
    wrong = []
    for row in table.strip().splitlines():
        request, has_answer, answer = row.strip().partition(" : ")
        assert has_answer, f"a row without an answer: {row}"
        result, _, words = answer.partition(" ")
        who, _, request = request.rpartition("> ")
        client = clients.get(who, world.client)
        packets, since = len(client.received), world.now
        texts, commands, plans = len(client.texts()), len(client.acks), len(acks(client))
        try:
            for each in request.split(" & "):
                ask(world, each, client)
        except AssertionError as error:
            error.add_note(f"in the row: {row.strip()}")
            raise
        if each.split()[0] not in WAITS:
            world.run(0.4)
        got = [MavResult(ack.result).name for ack in client.acks[commands:]]
        got += [MavMissionResult(ack.result).name for ack in acks(client)[plans:]]
        ids = {(p.message_id, p.source[1]) for p in client.received[packets:]}
        named = [
            f"{common.mavlink_map[n].msgname}@{by}" for n, by in ids if n in common.mavlink_map
        ]
        for packet in client.received[packets:]:
            if packet.message_id in PARAMETERS:
                each = client.decoded(packet)
                is_value = packet.message_id == PARAMETERS[0]
                what = f"={each.param_value:g}" if is_value else f": error {each.error}"
                named.append(each.param_id + what)
            elif packet.message_id == TASK_STATUS:
                it = TaskStatus.of(packet.payload[:132])  # it may repeat
                why = f"{TaskState(it.state).name} {TaskReason(it.reason).name}"
                named.append(f"status {it.task_id}: {why}")
        said = " | ".join(client.texts()[texts:] + named + facts(world, since))
        numbers = [f"#{ack.result_param2}" for ack in client.acks[commands:]]
        numbers += [f"#{ack.opaque_id}" for ack in acks(client)[plans:]]
        are_right = all(is_told(world, each, numbers, said) for each in words.split(" / "))
        if "+".join(got) != result.strip("-") or not are_right:
            wrong.append(f"{who} {request}: {got} {numbers} {said} {world.pose()}, not {answer}")
    assert not wrong, "\n".join(wrong)
