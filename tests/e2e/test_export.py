"""Recordings of real runs as MCAP; real processes, stock pymavlink."""

import json
import os
import resource
import stat
import subprocess
import sys
from collections import Counter
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("mcap", reason="the extra mcap is not installed")
os.environ.setdefault("MAVLINK20", "1")

from mcap.reader import NonSeekingReader, make_reader
from pymavlink import mavutil

from tests.kit.commands import called
from tests.kit.processes import free_tcp_ports, stand, submit, wait_for
from tests.unit.recording.mcap_export.json_schema import check


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
    assert stat.S_IMODE(run.mcap.stat().st_mode) == 0o600


@pytest.mark.slow
def test_a_full_disk_leaves_nothing_behind(run: Run, tmp_path: Path) -> None:
    limit = (8_192, 8_192)
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "mav_tasks.cli",
            "export",
            "--mcap",
            str(tmp_path / "out"),
            str(run.log),
        ],
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, limit),
    )
    assert done.returncode == 2
    assert done.stderr == f"mav-tasks: {tmp_path / 'out'}: File too large\n"
    assert list(tmp_path.iterdir()) == []
