"""``python -m rover_sim`` as a process, met over real UDP by plain pymavlink."""

import csv
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from rover_sim.__main__ import app

pytestmark = pytest.mark.interop

ROOT = Path(__file__).parents[2]
LIMIT = 15.0  # s for anything that a test waits for


READY = ("--boot", "none", "--peers", "all")  # unless a test says otherwise


@contextmanager
def simulator(*arguments: str) -> Iterator[tuple["subprocess.Popen[str]", int]]:
    """Run it on a free port; give the process and the port."""
    own = arguments if "--boot" in arguments else READY + arguments
    process = subprocess.Popen(
        [sys.executable, "-m", "rover_sim", "--port=0", *own],
        env={**os.environ, "PYTHONPATH": os.pathsep.join((str(ROOT), str(ROOT / "sim")))},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    try:
        line = process.stdout.readline()
        started = re.fullmatch(
            r"rover_sim: rover \d+ \(\w+, \w+\) on udp 127\.0\.0\.1:(\d+)\n", line
        )
        assert started, line
        yield process, int(started[1])
    finally:
        process.kill()
        process.communicate()


class Client:
    """A pymavlink ground station; independent of our codec."""

    def __init__(self, port: int) -> None:
        from pymavlink import mavutil
        from pymavlink.dialects.v20 import ardupilotmega

        self.dialect: Any = ardupilotmega
        self.link: Any = mavutil.mavlink_connection(
            f"udpout:127.0.0.1:{port}", source_system=255, dialect="ardupilotmega"
        )
        self.next_heartbeat = 0.0
        self.beat()

    def beat(self) -> None:
        if time.monotonic() >= self.next_heartbeat:
            self.next_heartbeat = time.monotonic() + 1.0
            self.link.mav.heartbeat_send(6, 8, 0, 0, 4)

    def wait(self, kind: str, condition: Callable[[Any], bool] = lambda _: True) -> Any:
        limit = time.monotonic() + LIMIT
        while time.monotonic() < limit:
            self.beat()
            message = self.link.recv_match(type=kind, blocking=True, timeout=0.2)
            if message is not None and condition(message):
                return message
        raise AssertionError(f"no such {kind} within {LIMIT} s")

    def ask(self, number: int, *params: float, system_id: int = 1) -> int:
        padded = (*params, *(0.0,) * (7 - len(params)))
        self.link.mav.command_long_send(system_id, 1, number, 0, *padded)
        ack = self.wait("COMMAND_ACK", lambda a: a.command == number)
        assert (ack.progress, ack.result_param2, ack.target_system) == (0, 0, 255)
        return int(ack.result)

    def forward(self, speed: float) -> None:
        self.link.mav.set_position_target_local_ned_send(
            0, 1, 1, 8, 0x05C7, 0, 0, 0, speed, 0, 0, 0, 0, 0, 0, 0
        )

    def close(self) -> None:
        self.link.close()


@contextmanager
def client(port: int) -> Iterator[Client]:
    connected = Client(port)
    try:
        yield connected
    finally:
        connected.close()


BODIES = [
    "kinematic",
    pytest.param("bullet", marks=pytest.mark.pybullet),
]


@pytest.mark.parametrize("body", BODIES)
def test_a_pymavlink_client_arms_drives_and_stops_a_rover(body: str, tmp_path: Path) -> None:
    truth = tmp_path / "truth.csv"
    with simulator("--body", body, "--truth", str(truth)) as (process, port), client(port) as c:
        beat = c.wait("HEARTBEAT")
        assert (beat.get_srcSystem(), beat.get_srcComponent()) == (1, 1)
        assert (beat.type, beat.autopilot) == (10, 3)
        c.wait("HEARTBEAT", lambda h: h.custom_mode == 0)
        for message_id in (30, 32):
            assert c.ask(511, message_id, 50_000) == 0
        assert c.ask(176, 1, 15) == 0
        while c.ask(400, 1) != 0:  # refused until its estimate has settled
            c.wait("ATTITUDE")
        start = c.wait("LOCAL_POSITION_NED")
        limit = time.monotonic() + LIMIT
        while (now := c.wait("LOCAL_POSITION_NED")).x - start.x < 1.0:
            assert time.monotonic() < limit
            c.forward(1.0)
        for _ in range(3):
            c.forward(0.0)
        c.wait("LOCAL_POSITION_NED", lambda p: abs(p.vx) < 0.05)  # noise of its estimate
        assert abs(now.y - start.y) < 0.1
        assert c.ask(176, 1, 4) == 0
        assert c.ask(400, 0) == 0
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=LIMIT) == 0
        assert process.stderr is not None
        assert process.stderr.read() == ""
    with truth.open(encoding="ascii") as file:
        rows = list(csv.DictReader(file))
    assert set(rows[0]) == {
        "time", "system_id", "north", "east", "yaw", "forward_speed", "yaw_rate"
    }  # fmt: skip
    assert float(rows[-1]["north"]) > 1.0
    assert len(rows) == pytest.approx(10 * float(rows[-1]["time"]), rel=0.2, abs=3)


def test_px4_answers_the_first_that_it_heard_and_nobody_else() -> None:
    px4 = ("--body", "kinematic", "--persona", "px4", "--boot", "short")
    with simulator(*px4) as (_, port), client(port) as first:
        first.wait("HEARTBEAT")
        with client(port) as second:
            assert second.link.recv_match(blocking=True, timeout=1.5) is None
        first.wait("HEARTBEAT")


def test_a_nan_setpoint_takes_it_down_as_it_does_the_real_one() -> None:
    with simulator("--body", "kinematic") as (process, port), client(port) as c:
        c.wait("HEARTBEAT", lambda h: h.custom_mode == 0)
        assert c.ask(176, 1, 15) == 0
        c.forward(float("nan"))
        assert process.wait(timeout=LIMIT) == 134
        assert process.stderr is not None
        assert "NaN" in process.stderr.read()


def test_bad_options_are_refused_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    for options, named in [
        (("--count", "0"), "--count"),
        (("--system-id", "255", "--count", "2"), "--system-id"),
        (("--speed", "never"), "--speed"),
        (("--persona", "betaflight"), "--persona"),
        (("--friction", "-1"), "--friction"),
        (("--friction", "nan"), "--friction"),
        (("--friction-variation", "0.3"), "--seed"),
        (("--friction-variation", "1.5", "--seed", "1"), "--friction-variation"),
    ]:
        with pytest.raises(SystemExit) as ended:
            app(options)
        assert ended.value.code == 2
        assert named in capsys.readouterr().err.splitlines()[-1]


def test_faults_happen_as_planned_on_the_command_line() -> None:
    plan = ("--fault", "at 0.1 s: reboot", "--fault", "at 0.2 s: lose-gps for 0.2 s")
    with simulator("--body", "kinematic", *plan) as (process, _):
        assert process.stdout is not None
        said = [process.stdout.readline().split(" s: ", 1)[1].strip() for _ in range(3)]
    assert said == [plan[1], plan[3], f"over: {plan[3]}"]


def test_a_fault_that_is_not_understood_ends_it_at_once(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, says in [
        (
            ["--fault", "at 1 s: bang"],
            "'--fault': unknown fault 'bang' in 'at 1 s: bang'; expected one of block-wheel",
        ),
        (["--fault", "rover 2 at 1 s: reboot"], "there is no rover 2"),
        (
            ["--frame", "ackermann", "--fault", "at 1 s: freeze-output left"],
            "throttle and steering, not 'left'",
        ),
    ]:
        with pytest.raises(SystemExit) as ended:
            app(arguments)
        assert ended.value.code == 2
        assert says in capsys.readouterr().err
