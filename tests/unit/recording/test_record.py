"""Decision records come back bit for bit; what is wrong with one is told in one clear line."""

import gzip
import os
import re
import time
import tracemalloc
from base64 import b64decode, b64encode
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from json import dumps, loads
from math import inf, nan
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from mav_tasks.basics.errors import RecordError
from mav_tasks.cli.app import app
from mav_tasks.config.key_ring import ring_file
from mav_tasks.config.key_ring.ring import Entry, KeyRing
from mav_tasks.config.settings import Clients, Recording, Retention, Settings
from mav_tasks.engine import inputs as i
from mav_tasks.engine.inputs import Input, LinkSide, Packets, Shutdown, WallClock
from mav_tasks.kinds import Move, Pose
from mav_tasks.links.memory import MemoryNet
from mav_tasks.mavlink.signing import Key
from mav_tasks.recording import observers
from mav_tasks.recording.observer import EngineObserver
from mav_tasks.recording.reading import read
from mav_tasks.shell.in_memory import InMemoryServer
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.task import Marks, Progress, Submitter, Task, TaskId, Terms
from rover_sim.body import Pose as RoverPose
from rover_sim.kinematic import KinematicBody
from rover_sim.vehicle import make_vehicle
from rover_sim.virtual import RoverParty, VirtualWorld

UTC = 1_763_726_400.0  # 2025-11-21T12:00:00Z
SENDER = Submitter("udpin:127.0.0.1:14560", "127.0.0.1:50000", 255, 190)


def begun(
    folder: Path, settings: Settings, restored: Restored | None = None, **options: Any
) -> EngineObserver:
    recording = Recording(decisions=str(folder), **options)
    (record,) = observers(recording, settings, restored, now=0.0)
    return record


def only_file(folder: Path) -> Path:
    (path,) = folder.iterdir()
    return path


def recorded(
    folder: Path,
    first: Input | None = None,
    *,
    seconds: float = 2.5,
    **options: Any,
) -> Path:
    """A record of a server that finds a rover and ends."""
    record = begun(folder, Settings(), **options)
    net = MemoryNet()
    world = VirtualWorld(net)
    body = KinematicBody(start=RoverPose(), slip=0.0, seed=None)
    rover = make_vehicle(body, system_id=1, now=0.0)
    server = InMemoryServer(net, vehicles=("rover",), observers=[record])
    server.pump.handle(first or WallClock(UTC), now=0.0)
    world.join(RoverParty(rover, net.link("rover")), server)
    world.run(seconds)
    server.pump.handle(Shutdown(), now=world.now)
    server.pump.turn(now=world.now)
    record.close()
    return only_file(folder)


def changed(path: Path, change: Callable[[list[Any]], list[Any]]) -> Path:
    """A copy with other lines."""
    lines = [loads(line) for line in gzip.decompress(path.read_bytes()).splitlines()]
    text = "".join(dumps(line, separators=(",", ":")) + "\n" for line in change(lines))
    other = path.parent.with_name("changed.gz")
    other.write_bytes(gzip.compress(text.encode()))
    return other


def said(path: Path, *options: str) -> tuple[int, str]:
    """What the command prints, and its exit code."""
    result = CliRunner().invoke(app, ["replay", str(path), *options])
    return result.exit_code, result.output


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("record") / "made")


def task(number: int) -> Task:
    """Return a task whose zeros have signs."""
    zero = 0.0 if number % 2 else -0.0
    terms = replace(Terms(), start_at=zero)
    progress = Progress(anchor=Pose(-0.0, 1, 1e-300), done=zero, jumps=(1, 2), speed=nan)
    made = Task(TaskId(number), 1, 54000, Move(2.0), SENDER, Marks(), -0.0, terms=terms)
    return replace(made, progress=progress)


RESTORED = Restored(
    tasks=tuple(task(number) for number in range(1, 6)),
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
SETTINGS = Settings(
    clients=Clients(priorities={"255/190": 7, "1/1@x": 0}, forget_after=inf, text_rate=3),
    retention=Retention(max_age=None),
    arming="operator",
)
PEERS = [("127.0.0.1", 14550), ("::1", 14550, 0, 0), "/dev/ttyUSB0", "rover1", 7]
INPUTS: list[Input | None] = [
    None,
    *(Packets("link", [(peer, b"\x00\xfd\xff"), (peer, b"")]) for peer in PEERS),
    Packets("link", [("x", b"1"), ("y", b"2")], [0.1 + 0.2, 0.0]),
    i.AtOnce((Packets("a", [("x", b"1")]), Packets("b", [("y", b"2")]))),
    i.AtOnce((Packets("a", [("x", b"1")], [20.5]), Packets("b", [(("h", 1), b"")]))),
    i.LinkChanged("udpin:x", LinkSide.CLIENTS, up=True, peers=(("h", 1), "x"), is_local=False),
    i.LinkChanged("tcp", LinkSide.VEHICLES, up=False, is_stream=True),
    i.PeerChanged("tcp", ("h", 1), up=True),
    i.Congestion("tcp", ("h", 1), is_congested=False),
    i.Committed(12),
    i.HaltsKept(11),
    i.StoreFailed("the disk is full: ä \ud800"),
    i.HaltNotStored(7),
    i.LeaseChanged(0.1 + 0.2, inf),
    i.IdsGranted(1000, 2),
    i.NonceTaken(1001, 7, "payload"),
    i.FleetChanged(((3, "a"), (7, "b"))),
    i.TasksElsewhere(((3, TaskState.EXECUTING), (7, None))),
    i.ParametersChanged((("TSK_SPEED", 0.1 + 0.2), ("TSK_X", 1.0))),
    i.VehiclesTaken((3, 7), replace(RESTORED, gateway="north")),
    i.VehiclesGone((3, 7)),
    i.SettingsChanged(SETTINGS),
    WallClock(-0.0),
    Shutdown(),
]


def test_settings_tasks_and_all_inputs_come_back_bit_for_bit(tmp_path: Path) -> None:
    record = begun(tmp_path, SETTINGS, RESTORED)
    times = (0.1 + 0.2, 5e-324, 1e300, 3)
    noted = [(item, now) for item in INPUTS for now in times]
    for item, now in noted:
        record.on_input(item, now=now)
    record.close()
    back = read(only_file(tmp_path))
    assert (repr(back.settings), repr(back.restored)) == (repr(SETTINGS), repr(RESTORED))
    assert back.restored is not None
    assert list(back.restored.paused) == [2, 1]  # in their order, too
    came = [(repr(back.input_of(entry)), repr(entry.now)) for entry in back.entries()]
    assert came == [(repr(item), repr(now)) for item, now in noted]


def test_a_peer_that_no_link_has_ends_the_record(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    record = begun(tmp_path, Settings())
    record.on_input(WallClock(1.0), now=1.0)
    record.on_input(Packets("clients", [(object(), b"x")]), now=1.5)
    record.close()
    back = read(only_file(tmp_path))
    assert (back.why_it_ends or "").startswith("unknown kind of peer: <object")
    assert [entry.kind for entry in back.entries()] == ["wall clock"]
    assert len(caplog.messages) == 1


def test_a_whole_record_is_replayed_and_its_events_are_shown(whole: Path) -> None:
    code, words = said(whole)
    assert code == 0
    first, *_, last = words.splitlines()
    assert first == "2025-11-21T12:00:00.126000Z rover 1: found (ardupilot)"
    assert last.startswith("same: ")
    assert said(whole, "--quiet") == (0, last + "\n")
    assert whole.stat().st_mode & 0o777 == 0o600
    code, words = said(whole, "--json")
    events = [loads(line) for line in words.splitlines()]
    assert code == 0
    assert events[0] == {
        "now": events[0]["now"],
        "time": "2025-11-21T12:00:00.126Z",
        "level": "info",
        "message": "rover 1: found (ardupilot)",
        "event": "VehicleSeen",
        "vehicle": 1,
        "text": "found (ardupilot)",
    }
    assert events[-1]["verdict"] == "same"
    assert events[-1]["difference"] is None
    quiet = said(whole, "--json", "--quiet")[1]
    assert [loads(line) for line in quiet.splitlines()] == events[-1:]


def otherwise(lines: list[Any]) -> list[Any]:
    """Let the record have found another rover than an engine does."""
    text = dumps(lines).replace("found (ardupilot)", "found (px4)")
    return loads(text)[:-1]  # type: ignore[no-any-return]  # without its digest


def flipped(lines: list[Any]) -> list[Any]:
    """Let the rover's first heartbeat say something else."""
    packets = next(
        line for line in lines[1:] if line[0] == "packets" and b64decode(line[3][0][1])[7] == 0
    )
    raw = bytearray(b64decode(packets[3][0][1]))
    raw[10] ^= 1
    packets[3][0][1] = b64encode(raw).decode()
    return lines


def test_an_engine_that_decides_otherwise_is_found_out_at_its_first_decision(whole: Path) -> None:
    code, words = said(changed(whole, otherwise))
    assert code == 1
    assert re.search(r"different after line \d+ \(packets at (0\.\d+) s, \1 s into", words)
    assert "\n  recorded: VehicleSeen(vehicle=1, text='found (px4)', at=0." in words
    assert "\n  replayed: VehicleSeen(vehicle=1, text='found (ardupilot)', at=0." in words
    code, words = said(changed(whole, otherwise), "--json")
    assert (code, loads(words.splitlines()[-1])["verdict"]) == (1, "different")
    with pytest.raises(RecordError, match="modified after it was written"):
        read(changed(whole, flipped))
    code, words = said(changed(whole, lambda lines: flipped(lines)[:-1]))
    assert code == 1
    assert "packets (digest " in words


def test_a_record_cut_anywhere_is_replayed_as_far_as_it_goes(whole: Path) -> None:
    cut = whole.parent.with_name("cut.gz")
    data = whole.read_bytes()
    for part in (0.95, 0.9, 0.5):
        cut.write_bytes(data[: int(len(data) * part)])
        code, words = said(cut)
        assert code == 0
        assert "the record's end is missing: replayed up to its last whole line" in words
        assert "same" in words.splitlines()[-1]


#: what is said | how many lines are kept | what changes in the first | lines after those
BAD_LINES = r"""is unreadable | -1 | {} | [["packets", 9.0, "x", [["y"]]]]
datagrams | 2 | {} | [["packets", 1.0, "x", [["y", "MQ=="]], [0.5, 0.5]]]
'melody' is unknown | -1 | {} | [["melody", 9.0]]
Settings.colour is unknown | 1 | {"settings": {"colour": "red"}} | []
its format is 2; this version reads 3 | 0 | {} | [{"mav-tasks record": 2}]
recorded by version 0.0.1, whose events have another | 1 | {"rows": {}, "version": "0.0.1"} | []
line 2 is not a task | 1 | {"restored": {"tasks": 1}} | [["deadline", 1.0]]
line 2 is unreadable | 1 | {} | [["link", "now"]]
not a record of decisions | 0 | {} | [[1, 2, 3]]
no peer | 2 | {} | [["peer", 1.0, "x", 0.5, true]]
line 2 is unreadable: not | 1 | {} | [["out", 1.0]]
unreadable tasks | 1 | {"restored": {"tasks": 1}} | [["task", [1]]]
ends before the run began | 1 | {"restored": {"tasks": 1}} | []
unreadable header: no words | 1 | {"version": "\u001b[31m1"} | []
unreadable header: no time | 1 | {"now": "noon"} | []
 is not a valid end mark | -1 | {} | [["end", "\u001b[31m", 1, ""]]"""


def edited(row: str, lines: list[Any]) -> list[Any]:
    """Return the lines of a record, changed as a row of BAD_LINES says."""
    _, count, change, more = row.split(" | ")
    kept = lines[: int(count)]
    kept[:1] = [line | loads(change) for line in kept[:1]]
    return [*kept, *loads(more)]


def test_what_this_version_cannot_read_is_said_in_one_line(whole: Path) -> None:
    for row in BAD_LINES.splitlines():
        words = row.partition(" | ")[0]
        path = changed(whole, partial(edited, row))
        result = CliRunner().invoke(app, ["replay", "--quiet", str(path)])
        assert isinstance(result.exception, RecordError), words
        told = str(result.exception)
        assert told.startswith(f"{path}: "), words
        assert words in told
        assert told.isprintable(), words


def test_a_file_that_is_none_is_said_so(whole: Path, tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="No such file"):
        read(tmp_path / "nothing")
    os.mkfifo(tmp_path / "pipe")  # nobody ever writes to it
    for path in (tmp_path, tmp_path / "pipe"):
        with pytest.raises(RecordError, match="not a file"):
            read(path)
    other = tmp_path / "other"
    beginning = [whole.read_bytes()[:cut] for cut in (0, 1, 40)]
    packed = [
        gzip.compress(b"x" * 70_000),
        gzip.compress(b"[" * 10**6),
        changed(whole, lambda lines: lines[:-1]).read_bytes() + b"more",
        whole.read_bytes() + b"more",
        whole.read_bytes() + gzip.compress(b"{}\n"),
    ]
    for data in (b"\x00" * 100, b"text", *packed, *beginning):
        other.write_bytes(data)
        with pytest.raises(RecordError):
            read(other)


def test_what_is_small_on_the_disk_and_large_to_read_is_refused_soon(tmp_path: Path) -> None:
    path = tmp_path / "bomb.gz"
    for data, times, words in (
        (b"\0", 10**8, "too long for a record"),
        (b"[]," * 3, 10**7, "too long for a record"),
        (b"\n", 10**7, "not a record of decisions"),
    ):
        head = b'{"mav-tasks record":3}\n' if b"," in data else b""
        path.write_bytes(gzip.compress(head + data * times, 1))
        tracemalloc.start()
        began = time.process_time()
        with pytest.raises(RecordError, match=words):
            read(path)
        took, (_, most) = time.process_time() - began, tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert took < 3
        assert most < 100e6


def test_a_record_ends_before_it_is_too_long(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = recorded(tmp_path, seconds=60, decisions_size=20_000)
    assert path.stat().st_size <= 20_000
    code, words = said(path)
    assert code == 0
    assert "ends before the run did: the record has reached its size limit" in words
    assert caplog.messages == [
        f"record of decisions {path} ends: the record has reached its size limit"
    ]


def test_a_record_of_signed_runs_is_replayed_with_the_key_ring_only(tmp_path: Path) -> None:
    anna = Key("anna", bytes(range(32)), "operator")
    ring = tmp_path / "keys.toml"
    ring_file.change(ring, lambda _: KeyRing((Entry("anna", "operator", anna),)))
    path = recorded(tmp_path / "made", i.KeysChanged((anna, replace(anna, name="b", secret=b""))))
    result = CliRunner().invoke(app, ["replay", str(path)])
    assert "its secret is missing; use --keys FILE" in str(result.exception)
    for options, beginning in (([], "      0."), (["--json"], '{"now": 0.')):
        code, words = said(path, "--keys", str(ring), *options)
        assert (code, words.startswith(beginning)) == (0, True), words


def test_a_record_that_ends_where_its_engine_failed_shows_that(whole: Path) -> None:
    bad: list[Any] = [["wall clock", 1.0, None], ["deadline", 9.0]]
    for end, code, told in ((1, 0, "same: "), (2, 1, "recorded: the run continued")):
        path = changed(whole, lambda lines, end=end: [*lines[:6], *bad[:end]])  # type: ignore[misc]
        got, words = said(path)
        assert (got, told in words, "the engine failed" in words) == (code, True, True), words
    older = changed(whole, lambda lines: [{**lines[0], "version": "0.0.7"}, *lines[1:6]])
    assert said(older)[1].startswith("recorded by version 0.0.7; this is ")
