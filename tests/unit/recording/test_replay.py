"""Records that are not as they should be, and engines that decide otherwise: each told clearly."""

import errno
import gzip
import os
import subprocess
import time
import tracemalloc
from collections.abc import Callable
from json import dumps, loads
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from mav_tasks.cli.app import app, main
from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import Committed, Packets, Shutdown, WallClock
from mav_tasks.errors import RecordError
from mav_tasks.in_memory import CLIENT_LINK, InMemoryServer
from mav_tasks.links.memory import MemoryNet
from mav_tasks.recording import decisions as decisions_module
from mav_tasks.recording.decisions import Decisions
from mav_tasks.recording.reading import read
from mav_tasks.recording.replay import Replay
from mav_tasks.recording.surroundings import restored_to_json
from mav_tasks.settings import Settings
from mav_tasks.tasks.restored import Restored
from rover_sim.body import Pose
from rover_sim.kinematic import KinematicBody
from rover_sim.vehicle import make_vehicle
from rover_sim.virtual import RoverParty, VirtualWorld

UTC = 1_763_726_400.0  # 2025-11-21T12:00:00Z


def recorded(folder: Path, *, seconds: float = 2.5, **options: Any) -> Path:
    """A record of a server that finds a rover and ends."""
    options = {"size": 10**7, **options}
    decisions = Decisions(folder, Settings(), None, now=0.0, **options)
    net = MemoryNet()
    world = VirtualWorld(net)
    body = KinematicBody(start=Pose(), slip=0.0, seed=None)
    rover = make_vehicle(body, system_id=1, now=0.0)
    server = InMemoryServer(net, vehicles=("rover",), observers=[decisions])
    server.pump.handle(WallClock(UTC), now=0.0)
    world.join(RoverParty(rover, net.link("rover")), server)
    world.run(seconds)
    server.pump.handle(Shutdown(), now=world.now)
    server.pump.turn(now=world.now)
    decisions.close()
    return decisions.path


def changed(path: Path, change: Callable[[list[Any]], list[Any]]) -> Path:
    """A copy with other lines."""
    lines = [loads(line) for line in gzip.decompress(path.read_bytes()).splitlines()]
    text = "".join(dumps(line, separators=(",", ":")) + "\n" for line in change(lines))
    other = path.with_name("changed.gz")
    other.write_bytes(gzip.compress(text.encode()))
    return other


def without_end(lines: list[Any]) -> list[Any]:
    return lines[:-1]


def run(path: Path) -> Replay:
    replay = Replay(read(path))
    for _ in replay.events():
        pass
    return replay


def said(path: Path, *options: str) -> tuple[int, str]:
    """What the command prints, and its exit code."""
    result = CliRunner().invoke(app, ["replay", str(path), *options])
    return result.exit_code, result.output


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("record"))


def test_a_whole_record_is_replayed_and_its_events_are_shown(whole: Path) -> None:
    code, words = said(whole)
    assert code == 0
    first, *_, last = words.splitlines()
    assert first == "2025-11-21T12:00:01.001000Z rover 1: found (ardupilot)"
    assert last.startswith("same: ")
    assert said(whole, "--quiet") == (0, last + "\n")
    assert whole.stat().st_mode & 0o777 == 0o600


def test_json_is_one_object_a_line(whole: Path) -> None:
    code, words = said(whole, "--json")
    events = [loads(line) for line in words.splitlines()]
    assert code == 0
    now = events[0]["now"]
    assert now == pytest.approx(1.001)
    assert events[0] == {
        "now": now,
        "time": "2025-11-21T12:00:01.001Z",
        "level": "info",
        "message": "rover 1: found (ardupilot)",
        "event": "VehicleSeen",
        "vehicle": 1,
        "text": "found (ardupilot)",
    }
    assert events[-1]["verdict"] == "same"
    assert (events[-1]["why_it_ends"], events[-1]["difference"]) == ("the run is over", None)
    quiet = said(whole, "--json", "--quiet")[1]
    assert [loads(line) for line in quiet.splitlines()] == events[-1:]


def test_a_changed_engine_is_found_out_at_its_first_decision(
    whole: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mav_tasks.engine.vehicles.vehicle_side.VehicleSeen", wrong_words)
    code, words = said(whole)
    assert code == 1
    shown = words.splitlines()
    assert shown[0].startswith("different after line 10 (packets at 1.001000 s, 1.001000 s into")
    assert shown[1].startswith(
        "  recorded: VehicleSeen(vehicle=1, text='found (ardupilot)', at=1.0"
    )
    assert shown[2].startswith("  replayed: VehicleSeen(vehicle=1, text='FOUND', at=1.0")
    code, words = said(whole, "--json")
    assert code == 1
    assert loads(words.splitlines()[-1])["difference"]["line"] == 10


def wrong_words(vehicle: int, text: str, at: float) -> Any:
    from mav_tasks.tasks.events import VehicleSeen

    return VehicleSeen(vehicle, "FOUND", at)


def test_packets_that_differ_are_named(whole: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    take = Engine.take_packets
    monkeypatch.setattr(
        Engine, "take_packets", lambda self: [p._replace(is_first=True) for p in take(self)]
    )
    difference = run(whole).difference
    assert difference is not None
    assert "packets (digest " in difference.expected
    assert "HEARTBEAT" in difference.came


def test_an_engine_that_does_more_at_the_end_differs(
    whole: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stop = Engine.handle

    def handle(self: Engine, item: Any, *, now: float) -> None:
        stop(self, item, now=now)
        if isinstance(item, Committed):
            self._journal.append(wrong_words(1, "", now))

    monkeypatch.setattr(Engine, "handle", handle)
    difference = run(whole).difference
    assert difference is not None
    assert "FOUND" in difference.came


@pytest.mark.patches_core
def test_an_engine_that_fails_differs_unless_the_run_ended_there(
    whole: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any, **__: Any) -> None:
        raise ZeroDivisionError("nought")

    monkeypatch.setattr("mav_tasks.engine.engine.Engine._shut_down", fail)
    difference = run(whole).difference
    assert difference is not None
    assert difference.came == "the engine failed: ZeroDivisionError: nought"
    until_then = changed(
        whole,
        lambda lines: lines[: next(n for n, line in enumerate(lines) if "shutdown" in line) + 1],
    )
    code, words = said(until_then)
    assert code == 0
    assert "the engine failed at the last input, as it did in the run: ZeroDivisionError" in words


def flipped(lines: list[Any]) -> list[Any]:
    """Lets the rover's first heartbeat say something else."""
    from base64 import b64decode, b64encode

    packets = next(
        line for line in lines[1:] if line[0] == "packets" and b64decode(line[3][0][1])[7] == 0
    )
    raw = bytearray(b64decode(packets[3][0][1]))
    raw[10] ^= 1
    packets[3][0][1] = b64encode(raw).decode()
    return lines


def test_a_record_that_was_changed_is_told_from_an_engine_that_was(whole: Path) -> None:
    with pytest.raises(RecordError, match="modified after it was written"):
        read(changed(whole, flipped))
    crashed = changed(whole, lambda lines: flipped(without_end(lines)))
    assert run(crashed).difference is not None


@pytest.mark.parametrize("part", [0.95, 0.9, 0.5])
def test_a_record_cut_anywhere_is_replayed_as_far_as_it_goes(whole: Path, part: float) -> None:
    cut = whole.with_name("cut.gz")
    data = whole.read_bytes()
    cut.write_bytes(data[: int(len(data) * part)])
    code, words = said(cut)
    assert code == 0
    assert "the record's end is missing: replayed up to its last whole line" in words
    assert "same" in words.splitlines()[-1]


@pytest.mark.parametrize("cut", [0, 1, 40])
def test_a_record_without_its_beginning_is_none(whole: Path, cut: int) -> None:
    other = whole.with_name("short.gz")
    other.write_bytes(whole.read_bytes()[:cut])
    with pytest.raises(RecordError, match="not a record of decisions"):
        read(other)


def with_tasks(first: dict[str, Any]) -> dict[str, Any]:
    return {**first, "restored": {**restored_to_json(Restored()), "tasks": 1}}


BAD_LINES: dict[str, Callable[[list[Any]], list[Any]]] = {
    "is unreadable": lambda lines: [*without_end(lines), ["packets", 9.0, "x", [["y"]]]],
    "'melody' is unknown": lambda lines: [*without_end(lines), ["melody", 9.0]],
    "line 2 is unreadable": lambda lines: [lines[0], ["link", "now"]],
    "line 3 is unreadable: cannot": lambda lines: [*lines[:2], 5],
    "unreadable header": lambda lines: [{**lines[0], "settings": {"x": 1}}],
    "unreadable header: KeyError": lambda lines: [{"mav-tasks record": 3, "version": "x"}],
    "its format is 2; this version reads 3": lambda lines: [{"mav-tasks record": 2}],
    "recorded by version 0.0.1, whose events have another format": lambda lines: [
        {**lines[0], "rows": {}, "version": "0.0.1"}
    ],
    "line 2 is not a task": lambda lines: [with_tasks(lines[0]), ["deadline", 1.0]],
    "unreadable tasks": lambda lines: [with_tasks(lines[0]), ["task", [1]]],
    "ends before the run began": lambda lines: [with_tasks(lines[0])],
    "not a record of decisions": lambda lines: [[1, 2, 3]],
    "unreadable header: no words": lambda lines: [
        {**lines[0], "version": "\x1b[31m1"},
        *without_end(lines)[1:],
    ],
    "unreadable header: no time": lambda lines: [
        {**lines[0], "now": "noon"},
        *without_end(lines)[1:],
    ],
    " is not a valid end mark": lambda lines: [*without_end(lines), ["end", "\x1b[31m", 1, ""]],
    "not a valid end mark": lambda lines: [*without_end(lines), ["end", 3]],
}


@pytest.mark.parametrize("words", BAD_LINES)
def test_what_this_version_cannot_read_is_said_in_one_line(
    whole: Path, words: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = changed(whole, BAD_LINES[words])
    monkeypatch.setattr("sys.argv", ["mav-tasks", "replay", "--quiet", str(path)])
    with pytest.raises(SystemExit) as left:
        main()
    out, err = capsys.readouterr()
    assert (left.value.code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith(f"mav-tasks: {path}: ")
    assert words in err


def test_a_file_that_is_none_is_said_so(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="No such file"):
        read(tmp_path / "nothing")
    os.mkfifo(tmp_path / "pipe")  # nobody ever writes to it
    for path in (tmp_path, tmp_path / "pipe"):
        with pytest.raises(RecordError, match="not a file"):
            read(path)
    other = tmp_path / "other"
    for data in (b"\x00" * 100, b"text", gzip.compress(b"x" * 70_000), gzip.compress(b"[" * 10**6)):
        other.write_bytes(data)
        with pytest.raises(RecordError):
            read(other)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"\0" * 10**8, "too long for a record"),
        (b'{"mav-tasks record":3}\n' + b"[]," * 3 * 10**7, "too long for a record"),
        (b"\n" * 10**7, "not a record of decisions"),
        (b"[" * 10**6 + b"\n" + b"\n" * 10**7, "not a record of decisions"),
    ],
)
def test_what_is_small_on_the_disk_and_large_to_read_is_refused_soon(
    tmp_path: Path, data: bytes, words: str
) -> None:
    path = tmp_path / "bomb.gz"
    path.write_bytes(gzip.compress(data, 1))
    del data
    tracemalloc.start()
    began = time.process_time()
    with pytest.raises(RecordError, match=words):
        read(path)
    took, (_, most) = time.process_time() - began, tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert took < 3
    assert most < 100e6


def test_another_version_is_named_and_tried(whole: Path) -> None:
    def older(lines: list[Any]) -> list[Any]:
        return [{**lines[0], "version": "0.0.7"}, *without_end(lines)[1:]]

    code, words = said(changed(whole, older))
    assert code == 0
    assert words.splitlines()[0].startswith("recorded by version 0.0.7; this is ")


def test_a_record_ends_before_it_is_too_long(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(decisions_module, "BLOCK", 2_000)
    path = recorded(tmp_path, seconds=60, size=9_000)
    assert 5_000 < path.stat().st_size <= 9_000
    code, words = said(path)
    assert code == 0
    assert "ends before the run did: the record has reached its size limit" in words
    assert caplog.messages == [
        f"record of decisions {path} ends: the record has reached its size limit"
    ]


def test_a_record_ends_when_too_much_waits(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mav_tasks.recording.writing.PERIOD", 60.0)
    path = recorded(tmp_path, most_waiting=20_000)
    code, words = said(path)
    assert code == 0
    assert "ends before the run did: the disk was too slow" in words
    assert len(caplog.messages) == 1


@pytest.mark.parametrize("room", [0, 200, 3_000])
def test_a_record_ends_with_a_mark_when_the_disk_fails(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, room: int
) -> None:
    """What the disk takes is counted from the first block on: then it is full for good."""
    monkeypatch.setattr(decisions_module, "BLOCK", 2_000)
    limit: list[int] = []
    write = os.write

    def written(fd: int, data: Any) -> int:
        size = os.fstat(fd).st_size
        if not limit:
            limit.append(size + len(data) + room)
        left = limit[0] - size
        if left <= 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(fd, bytes(data)[:left])

    monkeypatch.setattr("mav_tasks.recording.new_files.os.write", written)
    path = recorded(tmp_path, seconds=60)
    if room:
        code, words = said(path)
        assert code == 0
        assert "ends before the run did: the disk failed: No space left on device" in words
    else:  # the only block had to give way for the mark
        with pytest.raises(RecordError, match="not a record of decisions"):
            read(path)
    assert len(caplog.messages) == 1


def test_a_peer_that_no_link_has_ends_the_record(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    decisions = Decisions(tmp_path, Settings(), Restored(), now=0.0, size=10**6)
    decisions.on_input(WallClock(1.0), now=1.0)
    decisions.on_input(Packets(CLIENT_LINK, [(object(), b"x")]), now=1.5)
    decisions.close()
    record = read(decisions.path)
    assert (record.why_it_ends or "").startswith("unknown kind of peer: <object")
    assert [entry.kind for entry in record.entries()] == ["wall clock"]
    assert (record.restored, len(caplog.messages)) == (Restored(), 1)


def test_zcat_can_read_it(whole: Path) -> None:
    done = subprocess.run(["zcat", str(whole)], capture_output=True, timeout=10, check=True)
    kinds = [line[0] for line in map(loads, done.stdout.splitlines()[1:])]
    assert (kinds[0], kinds[-1]) == ("link", "end")
