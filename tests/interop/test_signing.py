"""Signing with others at the other end: pymavlink as client and as rover, MAVProxy."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

os.environ.setdefault("MAVLINK20", "1")

from pymavlink import mavutil

from tests.kit.commands import called
from tests.kit.mavproxy import mavproxy
from tests.kit.processes import (
    Stand,
    stand,
    submit,
    wait_until,
)

pytestmark = [pytest.mark.interop, pytest.mark.slow, pytest.mark.timeout(120)]

PASSPHRASE = "rovers-drive-home"
TASK_MOVE = 54000
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

    def __init__(self, port: int, secret: bytes, *, link_id: int = 0) -> None:
        self.link = mavutil.mavlink_connection(f"udpout:127.0.0.1:{port}", source_system=255)
        self.unsigned = 0

        def count(mav: Any, message_id: int) -> bool:
            self.unsigned += not only_radios(mav, message_id)
            return only_radios(mav, message_id)

        self.link.setup_signing(
            secret,
            sign_outgoing=True,
            allow_unsigned_callback=count,
            link_id=link_id,
        )

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


@pytest.mark.parametrize("link_id", [0, 255])
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


def test_mavproxy_with_its_passphrase(running: Stand, folder: Path) -> None:
    with mavproxy(running.client_port, folder, "--target-system", "1") as it:
        time.sleep(SILENCE)
        assert "Detected vehicle" not in it.text, "nobody who does not sign is spoken to"
        it.type("module load signing")
        it.ask(f"signing key {PASSPHRASE}", "Setup signing key")
        it.wait_for("Detected vehicle 1:1")
        it.ask("long 54000 0.1 0 0 0 0 0 5", r"COMMAND_ACK \{command : 54000, result : 0")
        it.wait_for(r"AP: Task \d+ done", within=20)
