"""Nothing is lost on the way into a record and back: bit for bit."""

from dataclasses import asdict, fields, replace
from json import loads
from math import inf, nan

import pytest

from mav_tasks.engine.inputs import (
    AtOnce,
    Committed,
    Congestion,
    FleetChanged,
    HaltNotStored,
    HaltsKept,
    IdsGranted,
    Input,
    LeaseChanged,
    LinkChanged,
    LinkSide,
    NonceTaken,
    Outgoing,
    Packets,
    ParametersChanged,
    PeerChanged,
    SettingsChanged,
    Shutdown,
    StoreFailed,
    TasksElsewhere,
    VehiclesGone,
    VehiclesTaken,
    WallClock,
)
from mav_tasks.recording.record_lines import (
    ROWS,
    LineWriter,
    Unwritable,
    described,
    dumps,
    input_of,
)
from mav_tasks.recording.surroundings import (
    restored_of,
    restored_to_json,
    settings_of,
)
from mav_tasks.settings import Clients, Retention, Settings
from mav_tasks.store.codec import Decoder
from mav_tasks.tasks.events import ServerStopped, VehicleSeen
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.server_events import ParameterSet
from mav_tasks.tasks.task import Pose, Progress, Task, TaskId, Terms
from tests.unit.tasks.samples import draft

PEERS = [("127.0.0.1", 14550), ("::1", 14550, 0, 0), "/dev/ttyUSB0", "rover1", 7]
_REGISTRY = TaskRegistry()
TAKEN_OVER = Restored(
    tasks=(_REGISTRY.submit(draft(), now=0.1 + 0.2), _REGISTRY.submit(draft(), now=2.5)),
    paused={3: TaskReason.OPERATOR},
    halt_epochs={3: 9, 7: 2},
    gateway="north",
)
INPUTS: list[Input | None] = [
    None,
    *(Packets("link", [(peer, b"\x00\xfd\xff"), (peer, b"")]) for peer in PEERS),
    Packets("link", [("x", b"1"), ("y", b"2")], [0.1 + 0.2, 0.0]),
    AtOnce((Packets("a", [("x", b"1")]), Packets("b", [("y", b"2")]))),
    AtOnce((Packets("a", [("x", b"1")], [20.5]), Packets("b", [(("h", 1), b"")]))),
    LinkChanged("udpin:x", LinkSide.CLIENTS, up=True, peers=(("h", 1), "x"), is_local=False),
    LinkChanged("tcp", LinkSide.VEHICLES, up=False, is_stream=True),
    PeerChanged("tcp", ("h", 1), up=True),
    Congestion("tcp", ("h", 1), is_congested=False),
    Committed(12),
    HaltsKept(11),
    StoreFailed("the disk is full: ä \ud800"),
    HaltNotStored(7),
    LeaseChanged(0.1 + 0.2, inf),
    IdsGranted(1000, 2),
    NonceTaken(1001, 7, "payload"),
    FleetChanged(((3, "a"), (7, "b"))),
    TasksElsewhere(((3, TaskState.EXECUTING), (7, None))),
    ParametersChanged((("TSK_SPEED", 0.1 + 0.2), ("TSK_X", 1.0))),
    VehiclesTaken((3, 7), TAKEN_OVER),
    VehiclesGone((3, 7)),
    SettingsChanged(Settings(clients=Clients(priorities={"255/190": 7}, stream_interval=0))),
    WallClock(-0.0),
    Shutdown(),
]


def test_packets_of_a_record_that_knows_no_waiting_are_read() -> None:
    line = ["packets", 1.0, "link", [["x", "MQ=="]]]
    assert input_of(line) == Packets("link", [("x", b"1")])


def test_as_many_waits_as_datagrams() -> None:
    with pytest.raises(ValueError, match="datagrams"):
        input_of(["packets", 1.0, "link", [["x", "MQ=="]], [0.5, 0.5]])


@pytest.mark.parametrize("item", INPUTS)
@pytest.mark.parametrize("now", [0.1 + 0.2, 5e-324, 1e300, 3])
def test_an_input_comes_back_as_it_was(item: Input | None, now: float) -> None:
    line = loads(LineWriter().taken(item, now=now))
    assert repr(input_of(line)) == repr(item)
    assert repr(line[1]) == repr(now)


def test_a_peer_of_no_link_is_refused() -> None:
    for peer in (1.5, None, ("h", ("x",)), b"x", True):
        with pytest.raises(Unwritable):
            LineWriter().taken(PeerChanged("tcp", peer, up=True), now=0.0)


def line(value: float | None) -> str:
    return LineWriter().given([], [ParameterSet("X", value, "server", 1.0)], now=1.0)


def test_values_that_are_equal_to_others_are_told_apart() -> None:
    different = [0.0, -0.0, 0, 1, 1.0, True, nan, inf, -inf, None]
    assert len({line(value) for value in different}) == len(different)
    assert line(nan) == line(-(inf - inf))
    at = [VehicleSeen(1, "found", now) for now in (0.0, -0.0, 0)]
    assert len({LineWriter().given([], [event], now=1.0) for event in at}) == 3


def test_each_part_of_what_is_sent_counts() -> None:
    one = Outgoing("link", "peer", b"data")
    others = [
        one._replace(link="knil"),
        one._replace(peer="reep"),
        one._replace(peer=("peer",)),
        one._replace(data=b"Data"),
        one._replace(is_first=True),
    ]
    sent = [[], [one], [one, one], *([other] for other in others), [one, others[0]]]
    sent += [[others[0], one]]
    assert len({LineWriter().given(packets, [], now=1.0) for packets in sent}) == len(sent)
    assert LineWriter().given([one], [], now=1.0) == LineWriter().given([one], [], now=1.0)


def test_settings_come_back_as_they_were() -> None:
    settings = Settings(
        clients=Clients(priorities={"255/190": 7, "1/1@x": 0}, forget_after=inf, text_rate=3),
        retention=Retention(max_age=None),
        arming="operator",
    )
    again = settings_of(loads(dumps(asdict(settings))))
    assert (again, repr(again)) == (settings, repr(settings))
    with pytest.raises(ValueError, match=r"Settings\.colour is unknown to this version"):
        settings_of({"colour": "red"})


def test_what_was_restored_comes_back_as_it_was() -> None:
    given = draft()
    progress = Progress(anchor=Pose(-0.0, 1, 1e-300), done=-0.0, jumps=(1, 2), speed=nan)
    tasks = tuple(
        Task(
            TaskId(number),
            given.vehicle,
            given.command,
            given.goal,
            given.submitter,
            given.marks,
            submitted_at=-0.0,
            terms=replace(Terms(), start_at=0.0 if number % 2 else -0.0),
            progress=replace(progress, done=0.0 if number % 2 else -0.0),
        )
        for number in range(1, 6)
    )
    restored = Restored(
        tasks=tasks,
        next_id=9,
        paused={2: TaskReason.STOPPED, 1: TaskReason.RESTARTED},
        uids={1: "x"},
        speeds={2: 0.3, 1: 1},
        halt_epochs={2: 7, 1: 1},
        halted={2: (TaskReason.OPERATOR, -0.0), 1: (TaskReason.STOPPED, 0.1)},
        plans={(2, 0): (7, "[]"), (1, 1): (3, "ä")},
        parameters={"B": -0.0, "A": 1.5},
        ended_well=False,
        idle=inf,
        wall_offset=1.8e9,
    )
    lines = [loads(LineWriter().task(task)) for task in tasks]
    decoder = Decoder(ROWS, is_exact=True)
    back = decoder.values(Task, [row for _, row in lines], offset=0.0)
    again = restored_of(loads(dumps(restored_to_json(restored))), tuple(back))
    assert repr(again) == repr(restored)
    assert list(again.paused) == [2, 1]  # in their order, too


def test_no_field_of_what_is_restored_is_forgotten() -> None:
    assert list(restored_to_json(Restored())) == [field.name for field in fields(Restored)]


def test_an_event_is_shown_with_the_names_of_its_fields() -> None:
    *_, (row,) = loads(LineWriter().given([], [ServerStopped((1, 2), 3.5)], now=3.5))
    assert described(row) == "ServerStopped(unconfirmed=[1, 2], at=3.5)"
