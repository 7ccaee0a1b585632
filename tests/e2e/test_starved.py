"""A server whose process stands still for a while, as on a machine that gives it no time."""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import NamedTuple

import pytest
from pymavlink.dialects.v20 import common

from tests.kit.lossy_udp import LossyUdp
from tests.kit.processes import command_long, stand, wait_for, wait_until

STOPPED = 5.0  # s
TIMEOUT = 3.0  # s, the rover's own, of setpoints
BRAKING = 2.0  # s, from 1 m/s to standing
MOVE, RELEASE, SKIP = 54000, 54013, 2
FAST = 1.0  # m/s
SETPOINT = 84


class Passed(NamedTuple):
    """A setpoint that left the server."""

    at: float
    moves: bool


class Tap(LossyUdp):
    """Loses nothing, and keeps what the server sends."""

    def __init__(self, port: int) -> None:
        self.setpoints: list[Passed] = []
        self._decoder = common.MAVLink(None)
        super().__init__(port)

    def see(self, data: bytes, *, is_for_server: bool) -> None:
        if is_for_server and data[7] == SETPOINT:  # the "server" of this proxy is the rover
            message = self._decoder.decode(bytearray(data))
            moves = any((message.vx, message.vy, message.yaw_rate))
            self.setpoints.append(Passed(monotonic(), moves))


@pytest.mark.slow
def test_a_server_that_stood_still_for_5_s_sends_no_old_setpoint_and_holds_the_task(
    tmp_path: Path,
) -> None:
    taps: list[Tap] = []

    @contextmanager
    def tapped(rover_port: int) -> Iterator[str]:
        tap = Tap(rover_port)
        taps.append(tap)
        try:
            yield f"udpout:127.0.0.1:{tap.port}"
        finally:
            tap.close()

    with stand(tmp_path, way=tapped) as running:
        (tap,) = taps
        link = running.connect()
        assert command_long(link, MOVE, 50.0, FAST, 0, 7).result == 0
        wait_until(lambda: running.speed() > 0.9 * FAST, within=20, what="the rover at speed")
        server = running.server.popen.pid

        os.kill(server, signal.SIGSTOP)
        stopped_at, was_at = monotonic(), running.truth()[-1]
        wait_until(lambda: running.speed() < 0.01, within=STOPPED, what="the rover to stand")
        stood_at = running.truth()[-1]
        wait_until(lambda: monotonic() - stopped_at > STOPPED, within=2 * STOPPED)
        assert max(passed.at for passed in tap.setpoints) < stopped_at + 0.2
        os.kill(server, signal.SIGCONT)
        went_on_at = monotonic()

        wait_for(link, "STATUSTEXT", "'held: server was late' in STATUSTEXT.text")
        wait_until(lambda: monotonic() - went_on_at > 2.0, within=5)
        after = [passed for passed in tap.setpoints if passed.at >= went_on_at]
        assert not any(passed.moves for passed in after)
        burst = [passed for passed in after if passed.at < after[0].at + 0.5] if after else []
        assert len(burst) <= 0.5 * 20 + 2  # 20 Hz: none of those missed is made up for
        now_at = running.truth()[-1]
        assert abs(now_at["north"] - stood_at["north"]) < 0.02  # nothing moved it again
        took = stood_at["time"] - was_at["time"]
        assert took < TIMEOUT + BRAKING
        assert stood_at["north"] - was_at["north"] < FAST * (TIMEOUT + BRAKING / 2)
        assert "Traceback" not in running.server.text
        assert command_long(link, RELEASE, 0, SKIP).result == 0  # it is there again
