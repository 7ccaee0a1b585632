"""mav-tasks trial on a simulated rover, with real processes: what a user sees."""

import signal
from pathlib import Path

import pytest

from tests.kit.processes import free_udp_ports, process, wait_until


def rover(port: int) -> tuple[str, ...]:
    """Return the command line of a simulated rover."""
    return ("-m", "rover_sim", "--port", str(port), "--boot", "none", "--truth", "truth.csv")


def trial(port: int, *more: str) -> tuple[str, ...]:
    """Return the command line of the trial."""
    url = f"udpout:127.0.0.1:{port}"
    command = ("-m", "mav_tasks.cli", "trial", url, "--only", "restart", "--truth", "truth.csv")
    return (*command, *more)


@pytest.mark.slow
@pytest.mark.timeout(120)
def test_the_trial_restarts_the_server_in_mid_move_and_writes_a_report(tmp_path: Path) -> None:
    (port,) = free_udp_ports(1)
    with process(*rover(port), folder=tmp_path, name="rover") as body:
        body.wait_for(" on udp")
        with process(*trial(port, "--yes"), folder=tmp_path, name="trial") as run:
            run.wait_for(r"\| restart +\| orderly restart .* \| PASS +\|\n", within=90)
            assert run.popen.wait(10) == 0, run.text
        with process(*trial(port, "--yes"), folder=tmp_path, name="again") as run:
            assert run.popen.wait(30) == 2
            assert "trial-report.md exists: name another one with --report" in run.text
    page = (tmp_path / "trial-report.md").read_text()
    assert "1 PASS, 0 FAIL" in page
    assert "- rover: ardupilot, system 1, firmware 4.6.3" in page
    assert "![tracks](trial-report.png)" in page
    assert (tmp_path / "trial-report.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
@pytest.mark.timeout(120)
def test_ctrl_c_stops_the_rover_and_ends_the_server(tmp_path: Path) -> None:
    (port,) = free_udp_ports(1)
    with process(*rover(port), folder=tmp_path, name="rover") as body:
        body.wait_for(" on udp")
        more = ("--yes", "--keep", "kept")
        with process(*trial(port, *more), folder=tmp_path, name="trial") as run:
            run.wait_for(r"\nrestart:")
            log = tmp_path / "kept/server.log"
            wait_until(lambda: "executing" in log.read_text(), within=60, what="the move to begin")
            run.popen.send_signal(signal.SIGINT)
            assert run.popen.wait(30) == 130, run.text
            assert "rover 1: STOP by" in log.read_text()
            assert "server stopped" in log.read_text()


def test_it_does_not_drive_unasked_or_with_what_cannot_be(tmp_path: Path) -> None:
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept/store.db").touch()
    for more, words in (
        ((), "the rover drives: without a terminal, add --yes"),
        (("--yes", "--keep", "kept"), "--keep kept is not empty"),
        (("--yes", "--reboot-command", "no-such x"), "no-such x: there is no such program"),
    ):
        with process(*trial(1, *more), folder=tmp_path, name="trial") as run:
            assert run.popen.wait(30) == 2
            assert words in run.text
