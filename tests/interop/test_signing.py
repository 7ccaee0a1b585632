"""Signing with others at the other end: pymavlink as client and as rover, MAVProxy."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

os.environ.setdefault("MAVLINK20", "1")

from pymavlink import mavutil

from tests.kit.commands import called
from tests.kit.mavproxy import mavproxy
from tests.kit.processes import (
    Stand,
    command_long,
    free_udp_ports,
    process,
    stand,
    submit,
    wait_until,
)

pytestmark = [pytest.mark.interop, pytest.mark.slow, pytest.mark.timeout(120)]

PASSPHRASE = "rovers-drive-home"
TASK_MOVE = 54000
HEARTBEAT, SETPOINT, COMMAND = 0, 84, 76
RADIO_STATUS = 109
SILENCE = 1.5  # s, in which an answer would have come


def made_ring(folder: Path) -> tuple[Path, dict[str, bytes]]:
    """Make a ring by the command line: a key of each kind, and MAVProxy's of a passphrase."""
    ring, secrets = folder / "keys.toml", {}
    for name, role in (("py", "operator"), ("other", "operator"), ("r1", "vehicle")):
        done = called("keys", "add", name, "--role", role, "--keys", str(ring))
        secrets[name] = bytes.fromhex(done.output.strip())
    subprocess.run(
        [
            *(sys.executable, "-m", "mav_tasks.cli", "keys", "add", "proxy", "--role", "operator"),
            *("--passphrase", "--keys", str(ring)),
        ],
        input=PASSPHRASE.encode(),
        check=True,
        capture_output=True,
    )
    return ring, secrets


def only_radios(_mav: Any, message_id: int) -> bool:
    return message_id == RADIO_STATUS


class Signing:
    """A pymavlink connection that signs, and counts what it does not believe."""

    def __init__(self, port: int, secret: bytes, *, link_id: int = 0, stamp: int | None = None):
        self.link = mavutil.mavlink_connection(f"udpout:127.0.0.1:{port}", source_system=255)
        self.unsigned = 0

        def count(mav: Any, message_id: int) -> bool:
            self.unsigned += not only_radios(mav, message_id)
            return only_radios(mav, message_id)

        self.link.setup_signing(
            secret,
            sign_outgoing=True,
            allow_unsigned_callback=count,
            initial_timestamp=stamp,
            link_id=link_id,
        )
        self.sent: list[bytes] = []
        write = self.link.write

        def noted(data: bytes) -> None:
            self.sent.append(bytes(data))
            write(data)

        self.link.write = noted
        self.link.mav.file = self.link

    @property
    def counts(self) -> tuple[int, int]:
        """Return the packets believed, and those signed but not believed."""
        return self.link.mav.signing.goodsig_count, self.link.mav.signing.badsig_count

    def hello(self) -> None:
        """Say hello until the rover is heard."""

        def heard() -> Any:
            self.link.mav.heartbeat_send(6, 8, 0, 0, 4)
            return self.link.recv_match(type="LOCAL_POSITION_NED", blocking=True, timeout=0.5)

        wait_until(heard, within=10, what="a position that pymavlink believes")

    def is_answered(self, *params: float) -> bool:
        """Whether a TASK_MOVE has an ack."""
        filled = (*params, *(0.0,) * (7 - len(params)))
        self.link.mav.command_long_send(1, 191, TASK_MOVE, 0, *filled)
        ack = self.link.recv_match(type="COMMAND_ACK", blocking=True, timeout=SILENCE)
        return ack is not None

    def close(self) -> None:
        """End it."""
        self.link.close()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the stand has its files."""
    return tmp_path_factory.mktemp("signing")


@pytest.fixture(scope="module")
def secrets(folder: Path) -> dict[str, bytes]:
    """The secrets of the ring, by name."""
    return made_ring(folder)[1]


@pytest.fixture(scope="module")
def running(folder: Path, secrets: dict[str, bytes]) -> Iterator[Stand]:
    """A server on whose link for clients all is signed."""
    assert secrets
    ring = ("--keys", str(folder / "keys.toml"))
    with stand(folder, *ring, client_options="?unsigned=refuse") as it:
        yield it


@pytest.fixture
def connect(running: Stand) -> Iterator[Callable[..., Signing]]:
    """Return signing pymavlink connections."""
    made: list[Signing] = []

    def connected(secret: bytes, **options: Any) -> Signing:
        made.append(Signing(running.client_port, secret, **options))
        return made[-1]

    yield connected
    for each in made:
        each.close()


@pytest.mark.parametrize("link_id", [0, 7, 255])
def test_pymavlink_commands_and_believes_all_that_it_hears(
    connect: Callable[..., Signing], secrets: dict[str, bytes], link_id: int
) -> None:
    client = connect(secrets["py"], link_id=link_id)
    client.hello()
    task = submit(client.link, TASK_MOVE, 0.1)
    assert task > 0
    wait_until(lambda: text_of(client.link, f"Task {task} done"), within=20, what="the end")
    good, bad = client.counts
    assert good > 20
    assert (bad, client.unsigned) == (0, 0)


def text_of(link: Any, words: str) -> bool:
    message = link.recv_match(type="STATUSTEXT", blocking=True, timeout=1)
    return message is not None and words in message.text


def test_another_key_is_not_answered(connect: Callable[..., Signing]) -> None:
    client = connect(b"s" * 32)
    client.link.mav.heartbeat_send(6, 8, 0, 0, 4)
    assert not client.is_answered(1.0)
    assert client.counts == (0, 0)
    assert client.unsigned == 0


def stamp(seconds_ago: float) -> int:
    return int((time.time() - seconds_ago - 1_420_070_400) * 100_000)


@contextmanager
def plain_socket() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.settimeout(SILENCE)
        yield sock


def is_heard(raw: bytes, port: int) -> bool:
    """Whether somebody else who says the same bytes again is answered."""
    with plain_socket() as attacker:
        attacker.sendto(raw, ("127.0.0.1", port))
        try:
            attacker.recv(300)
        except TimeoutError:
            return False
        return True


def test_the_same_bytes_again_do_nothing_not_even_after_sigkill(
    tmp_path: Path,
) -> None:
    """The server is killed within milliseconds of its answer, and started on the same store."""
    ring, secrets = made_ring(tmp_path)
    port, rover_port = free_udp_ports(2)
    serve = ["-m", "mav_tasks.cli", "serve", "--no-push", "--store", str(tmp_path / "s.sqlite3")]
    serve += ["--client", f"udpin:127.0.0.1:{port}?unsigned=refuse"]
    serve += ["--vehicle", f"udpout:127.0.0.1:{rover_port}", "--keys", str(ring)]
    rover = ["-m", "rover_sim", "--port", str(rover_port), "--body", "kinematic"]
    rover += ["--boot", "none"]
    with process(*rover, folder=tmp_path, name="rover"):
        with process(*serve, folder=tmp_path, name="first") as first:
            first.wait_for("rover 1: found")
            client = Signing(port, secrets["py"])
            client.hello()
            task = submit(client.link, TASK_MOVE, 30.0)
            raw = next(data for data in client.sent if data[7] == COMMAND)
            assert not is_heard(raw, port)
            first.end(signal.SIGKILL)
        with process(*serve, folder=tmp_path, name="second") as second:
            second.wait_for("rover 1: found")
            assert not is_heard(raw, port)
            client.hello()  # whose time goes on
            again = command_long(client.link, TASK_MOVE, 0.1)
            assert (again.result, again.result_param2) == (0, task + 1)
            assert client.counts[1] == 0
            client.close()
            second.end()


def test_mavproxy_with_its_passphrase(running: Stand, folder: Path) -> None:
    with mavproxy(running.client_port, folder, "--target-system", "1") as it:
        time.sleep(SILENCE)
        assert "Detected vehicle" not in it.text, "nobody who does not sign is spoken to"
        it.type("module load signing")
        it.ask(f"signing key {PASSPHRASE}", "Setup signing key")
        it.wait_for("Detected vehicle 1:1")
        it.ask("long 54000 0.1 0 0 0 0 0 5", r"COMMAND_ACK \{command : 54000, result : 0")
        it.wait_for(r"AP: Task \d+ done", within=20)
