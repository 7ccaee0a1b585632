"""Recordings of real runs as MCAP, and telemetry logs back; real processes, stock pymavlink."""

import json
import math
import os
import resource
import stat
import subprocess
import sys
from collections import Counter
from contextlib import closing, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("mcap", reason="the extra mcap is not installed")
os.environ.setdefault("MAVLINK20", "1")

from mcap.reader import NonSeekingReader, make_reader
from pymavlink import mavutil

from mav_tasks import Move, SyncClient
from mav_tasks.key_ring.ring_file import load
from tests.kit.commands import called, mav_tasks
from tests.kit.processes import free_tcp_ports, stand, submit, wait_for
from tests.unit.mcap_export.json_schema import check

SIGNED = bytes((0xFD, 1))  # magic and incompat flags of a packet


@dataclass(frozen=True)
class Run:
    """The recordings of a run, and the file made of them."""

    log: Path
    record: Path
    mcap: Path

    def messages(self, *topics: str) -> list[Any]:
        """Return (channel, message, decoded JSON) of topics, by the package's own reader."""
        with self.mcap.open("rb") as file:
            reader = make_reader(file, validate_crcs=True)
            return [
                (channel, message, json.loads(message.data))
                for _, channel, message in reader.iter_messages(topics=topics)
            ]

    def values(self, topic: str) -> list[Any]:
        """Return the decoded JSON of a topic."""
        return [values for _, _, values in self.messages(topic)]

    def packets(self) -> list[Any]:
        """Return what pymavlink reads in the log."""
        with closing(mavutil.mavlink_connection(str(self.log))) as log:
            return list(iter(log.recv_msg, None))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A move and a turn of an ArduPilot rover, submitted on two links, UDP and TCP."""
    folder = tmp_path_factory.mktemp("run")
    (port,) = free_tcp_ports(1)
    recording = ("--tlog", str(folder / "logs"), "--record", str(folder / "records"))
    with stand(folder, *recording, "--client", f"tcpin:127.0.0.1:{port}") as it:
        first = it.connect()
        second = it.heard(f"tcp:127.0.0.1:{port}", 200)
        task = submit(first, 54000, 0.5)
        wait_for(first, "STATUSTEXT", f"'Task {task} done' in STATUSTEXT.text", within=20)
        task = submit(second, 54001, 30.0)
        wait_for(second, "STATUSTEXT", f"'Task {task} done' in STATUSTEXT.text", within=20)
        it.server.end()
    (log,), (record,) = (folder / "logs").iterdir(), (folder / "records").iterdir()
    out = folder / "run.mcap"
    done = called("export", "--mcap", str(out), str(log), str(record))
    assert (done.status, done.error) == (0, "")
    assert done.output.startswith(f"{out}: ")
    return Run(log, record, out)


@pytest.mark.slow
def test_the_log_of_a_run_comes_back(run: Run, tmp_path: Path) -> None:
    back = tmp_path / "back.tlog"
    done = called("export", "--tlog", str(back), str(run.mcap), "--json")
    assert done.objects == [{"done": "export", "file": str(back), "bytes": run.log.stat().st_size}]
    assert back.read_bytes() == run.log.read_bytes()
    assert stat.S_IMODE(back.stat().st_mode) == stat.S_IMODE(run.mcap.stat().st_mode) == 0o600


@pytest.mark.slow
def test_another_reader_finds_each_message_and_no_fault(run: Run) -> None:
    expected = Counter(
        f"/mavlink/{each.get_srcSystem()}/{each.get_srcComponent()}/{each.get_type()}"
        for each in run.packets()
    )
    found: Counter[str] = Counter()
    with run.mcap.open("rb") as file:
        for schema, channel, message in NonSeekingReader(file, validate_crcs=True).iter_messages():
            found[channel.topic] += 1
            if channel.message_encoding == "json":
                assert schema is not None
                check(json.loads(message.data), json.loads(schema.data), channel.topic)
    assert {t: n for t, n in found.items() if t in expected} == expected
    assert found["/mavlink/raw"] == expected.total()


@pytest.mark.slow
def test_fields_times_and_numbers_are_those_that_pymavlink_reads(run: Run) -> None:
    topic = "/mavlink/1/1/LOCAL_POSITION_NED"
    found = run.messages(topic)
    expected = [each for each in run.packets() if each.get_type() == "LOCAL_POSITION_NED"]
    assert len(found) == len(expected) > 20
    for (_, message, values), packet in zip(found, expected, strict=True):
        assert message.log_time / 1e9 == pytest.approx(packet._timestamp, abs=1e-6)
        assert message.sequence == packet.get_seq()
        told = packet.to_dict()
        del told["mavpackettype"]
        assert values == pytest.approx(told, rel=1e-8)


@pytest.mark.slow
def test_the_rover_is_drawn_where_it_drove(run: Run) -> None:
    first, *_, last = run.values("/rover/1/pose")
    position, orientation = last["pose"]["position"], last["pose"]["orientation"]
    assert first["pose"]["position"]["y"] == pytest.approx(0.0, abs=0.05)
    assert position["y"] == pytest.approx(0.5, abs=0.05)  # north
    heading = 2 * math.atan2(orientation["z"], orientation["w"])  # from east, to the left
    assert math.degrees(heading) == pytest.approx(90 - 30, abs=3)
    place = run.values("/rover/1/location")[-1]
    assert place["latitude"] == pytest.approx(-35.363262 + 0.5 / 111_195, abs=2e-6)


@pytest.mark.slow
def test_setpoints_tasks_and_texts_are_those_of_the_run(run: Run) -> None:
    sent = [each for each in run.packets() if each.get_type() == "SET_POSITION_TARGET_LOCAL_NED"]
    setpoints = run.values("/rover/1/setpoints/250/191")
    assert [each["vx"] for each in setpoints] == pytest.approx([each.vx for each in sent])
    assert max(each["vx"] for each in setpoints) > 0.1
    changes = run.values("/tasks/changes")
    for task in (1, 2):
        states = [each["state"] for each in changes if each["task"] == task]
        assert states == ["queued", "starting", "executing", "completed"]
    texts = [each["message"] for each in run.values("/texts")]
    assert {"Task 1 done", "Task 2 done"} <= set(texts)
    assert "rover 1: task 1 starting" in {each["message"] for each in run.values("/tasks/log")}


@pytest.mark.slow
def test_a_record_alone_has_the_links(run: Run, tmp_path: Path) -> None:
    out = tmp_path / "record.mcap"
    assert called("export", "--mcap", str(out), str(run.record)).status == 0
    it = Run(run.log, run.record, out)
    commands = it.messages("/mavlink/255/0/COMMAND_LONG", "/mavlink/200/0/COMMAND_LONG")
    assert [channel.metadata["side"] for channel, *_ in commands] == ["clients", "clients"]
    one, other = (channel.metadata["link"] for channel, *_ in commands)
    assert one.startswith("udpin:")
    assert other.startswith("tcpin:")
    (channel, *_), *_ = it.messages("/mavlink/1/1/ATTITUDE")
    assert channel.metadata["side"] == "vehicles"
    assert it.values("/rover/1/setpoints/250/191") == []  # a record has a digest of what was sent


@pytest.mark.slow
def test_a_signed_run_comes_back(tmp_path: Path) -> None:
    ring = tmp_path / "keys.toml"
    for name, role in (("r1", "vehicle"), ("anna", "operator")):
        assert called("keys", "add", name, "--role", role, "--keys", str(ring)).status == 0
    logs, back = tmp_path / "logs", tmp_path / "back"
    with stand(
        tmp_path,
        *("--keys", str(ring), "--tlog", str(logs)),
        client_options="?unsigned=refuse",
        rover_options=("--sign", "r1", "--keys", str(ring)),
        way=lambda port: nullcontext(f"udpout:127.0.0.1:{port}?key=r1"),
    ) as it:
        key = load(ring).ring.usable_key("anna")
        with SyncClient(f"udpout:127.0.0.1:{it.client_port}", key=key) as client:
            assert client.submit(Move(0.3)).done(timeout=30).is_over
        it.server.end()
    (log,) = logs.iterdir()
    assert log.read_bytes()[8:11:2] == SIGNED
    out = tmp_path / "run.mcap"
    assert called("export", "--mcap", str(out), str(log)).status == 0
    back.mkdir()
    assert called("export", "--tlog", str(back), str(out)).status == 0
    assert (back / log.name).read_bytes() == log.read_bytes()
    assert Run(log, log, out).values("/rover/1/pose")


def one_clear_line(*arguments: str | Path) -> str:
    """Run a command that fails; return its line."""
    done = called("export", *map(str, arguments))
    assert (done.status, done.output) == (2, "")
    (line,) = done.error.splitlines()
    return line.removeprefix("mav-tasks: ")


@pytest.mark.slow
def test_what_is_wrong_is_one_clear_line(run: Run, tmp_path: Path) -> None:
    out, text = tmp_path / "out", tmp_path / "text"
    text.write_text("no recording, but a text that is a little longer\n", encoding="ascii")
    assert one_clear_line("--mcap", out, text) == f"{text}: not a telemetry log"
    assert one_clear_line("--mcap", out, run.mcap) == f"{run.mcap}: not a telemetry log"
    assert one_clear_line("--mcap", out, tmp_path) == f"{tmp_path}: not a file"
    nowhere = tmp_path / "none"
    missing = f"{nowhere}: No such file or directory"
    assert one_clear_line("--mcap", out, nowhere) == missing
    assert one_clear_line("--tlog", out, nowhere) == missing
    assert one_clear_line("--tlog", out, text) == f"{text}: not an MCAP file"
    assert one_clear_line("--tlog", out, text, text) == "--tlog takes one MCAP file, not 2"
    assert one_clear_line("--mcap", nowhere / "out", run.log).startswith(f"{nowhere / 'out'}: No")
    both = "choose one of --mcap OUT and --tlog OUT"
    assert one_clear_line(run.log) == both
    assert one_clear_line("--mcap", out, "--tlog", out, run.log) == both
    assert list(tmp_path.iterdir()) == [text]


@pytest.mark.slow
def test_nothing_is_overwritten_unless_that_is_said(run: Run, tmp_path: Path) -> None:
    out = tmp_path / "out.mcap"
    out.write_text("mine", encoding="ascii")
    line = one_clear_line("--mcap", out, run.log)
    assert line == f"{out} exists; use --force to overwrite it"
    assert out.read_text(encoding="ascii") == "mine"
    assert called("export", "--force", "--mcap", str(out), str(run.log)).status == 0
    for way, source in (("--mcap", run.log), ("--tlog", run.mcap)):
        line = one_clear_line(way, source, "--force", source)
        assert line == f"{source} is also read: name another file"
    assert one_clear_line("--mcap", "/dev/null", "--force", run.log) == "/dev/null: not a file"
    assert one_clear_line("--mcap", tmp_path, "--force", run.log) == f"{tmp_path}: not a file"


@pytest.mark.slow
def test_several_logs_need_a_folder_and_come_back_by_name(run: Run, tmp_path: Path) -> None:
    copy, out, back = tmp_path / "copy.tlog", tmp_path / "out.mcap", tmp_path / "back"
    copy.write_bytes(run.log.read_bytes()[:-3])
    assert called("export", "--mcap", str(out), str(run.log), str(copy)).status == 0
    line = one_clear_line("--tlog", tmp_path / "one.tlog", out)
    assert line == f"{out}: has several telemetry logs; name a folder for them: --tlog FOLDER"
    assert not (tmp_path / "one.tlog").exists()
    back.mkdir()
    assert called("export", "--tlog", str(back), str(out)).status == 0
    assert {path.name: path.read_bytes() for path in back.iterdir()} == {
        each.name: each.read_bytes() for each in (run.log, copy)
    }


@pytest.mark.slow
@pytest.mark.parametrize("way", ["--mcap", "--tlog"])
def test_a_full_disk_leaves_nothing_behind(run: Run, tmp_path: Path, way: str) -> None:
    source = run.log if way == "--mcap" else run.mcap
    limit = (8_192, 8_192)
    done = subprocess.run(
        [sys.executable, "-m", "mav_tasks.cli", "export", way, str(tmp_path / "out"), str(source)],
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, limit),
    )
    assert done.returncode == 2
    assert done.stderr == f"mav-tasks: {tmp_path / 'out'}: File too large\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_missing_package_is_named_with_what_installs_it(run: Run, tmp_path: Path) -> None:
    (tmp_path / "mcap.py").touch()  # has none of its modules
    out = str(tmp_path / "out")
    for way in ("--mcap", "--tlog"):
        done = mav_tasks("export", way, out, str(run.log), PYTHONPATH=str(tmp_path))
        assert done.status == 2
        assert done.error == (
            "mav-tasks: export needs the package mcap: run pip install '.[mcap]' in the folder of"
            " mav-tasks\n"
        )
