"""./tools/field_trial on a simulated rover, with real processes: what a user sees."""

import signal
from pathlib import Path

import pytest

from tests.kit.processes import free_udp_ports, process, wait_until

ROWS = "restart"


def rover(port: int, truth: Path) -> tuple[str, ...]:
    """Return the command line of a simulated rover."""
    return ("-m", "rover_sim", "--port", str(port), "--boot", "none", "--truth", str(truth))


def trial(port: int, truth: Path, *more: str) -> tuple[str, ...]:
    """Return the command line of the trial."""
    url = f"udpout:127.0.0.1:{port}"
    return ("-m", "rover_sim.field_trial", url, "--yes", "--truth", str(truth), *more)


@pytest.mark.slow
@pytest.mark.timeout(120)
def test_the_trial_restarts_the_server_in_mid_move_and_prints_the_table(tmp_path: Path) -> None:
    (port,) = free_udp_ports(1)
    truth = tmp_path / "truth.csv"
    with process(*rover(port, truth), folder=tmp_path, name="rover") as body:
        body.wait_for(" on udp")
        with process(*trial(port, truth, "--only", ROWS), folder=tmp_path, name="trial") as run:
            run.wait_for(r"restart +orderly restart .*\n", within=90)
            assert run.popen.wait(10) in (0, 1), run.text
            assert "PASS" in run.text, run.text


@pytest.mark.slow
@pytest.mark.timeout(120)
def test_ctrl_c_stops_the_rover_and_ends_the_server(tmp_path: Path) -> None:
    (port,) = free_udp_ports(1)
    truth, kept = tmp_path / "truth.csv", tmp_path / "kept"
    more = ("--only", ROWS, "--keep", str(kept))
    with process(*rover(port, truth), folder=tmp_path, name="rover") as body:
        body.wait_for(" on udp")
        with process(*trial(port, truth, *more), folder=tmp_path, name="trial") as run:
            run.wait_for(r"\nrestart:")
            log = kept / "server.log"
            wait_until(lambda: "executing" in log.read_text(), within=60, what="the move to begin")
            run.popen.send_signal(signal.SIGINT)
            assert run.popen.wait(30) == 130, run.text
            assert "rover 1: STOP by" in log.read_text()
            assert "server stopped" in log.read_text()
