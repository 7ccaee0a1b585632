"""The probe's shell: whatever goes wrong in it, the rover is told to stand."""

import asyncio
import io
import os
import signal
from collections.abc import Iterator

import pytest

from mav_tasks import probing
from mav_tasks.cli import probe as command
from mav_tasks.errors import UsageError
from mav_tasks.links.base import Peer
from mav_tasks.links.udp import UdpUrl
from mav_tasks.probe.probe import Options, Probe

URL = "udpout:127.0.0.1:14580"


class FakeLink:
    """A link on which nobody answers."""

    name = "fake"
    peers: tuple[Peer, ...] = ("rover",)
    is_local = True
    is_stream = False
    note = ""

    def __init__(self) -> None:
        self.ends = os.pipe()
        self.sent: list[bytes] = []
        self.is_closed = False

    def fileno(self) -> int:
        return self.ends[0]

    def receive(self, limit: int) -> list[tuple[Peer, bytes]]:
        return []

    def send(self, peer: Peer, data: bytes) -> None:
        self.sent.append(data)

    def close(self) -> None:
        self.is_closed = True
        for end in self.ends:
            os.close(end)


class Driving(Probe):
    """One that has a rover in its hands."""

    def emergency_stop_packets(self) -> list[bytes]:
        return [b"zero", b"hold"]


class Mistaken(Driving):
    """One that fails at its first turn."""

    def handle_deadline(self, *, now: float) -> None:
        raise ZeroDivisionError


class Obedient(Driving):
    """One that is asked to end in its first turn, and does."""

    number = signal.SIGTERM

    def handle_deadline(self, *, now: float) -> None:
        super().handle_deadline(now=now)
        signal.raise_signal(self.number)


class Stubborn(Driving):
    """One that does not end when it is asked to; it asks for signals itself."""

    def handle_deadline(self, *, now: float) -> None:
        super().handle_deadline(now=now)
        signal.raise_signal(signal.SIGINT)

    def interrupt(self, words: str, *, now: float) -> None:
        signal.raise_signal(signal.SIGINT)


@pytest.fixture
def link(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeLink]:
    made = FakeLink()
    monkeypatch.setattr(UdpUrl, "open", lambda *_, **__: made)
    yield made
    assert made.is_closed


def run() -> tuple[Probe, int]:
    return asyncio.run(
        asyncio.wait_for(
            probing.run_probe(URL, Options(), insecure=False, on_stage=lambda _: None), 10
        )
    )


def test_our_own_mistake_stops_the_rover_and_is_not_hidden(
    link: FakeLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(probing, "Probe", Mistaken)
    with pytest.raises(ZeroDivisionError):
        run()
    assert link.sent[:2] == [b"zero", b"hold"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_it_in_order(
    link: FakeLink, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    monkeypatch.setattr(Obedient, "number", number)
    monkeypatch.setattr(probing, "Probe", Obedient)
    probe, ended_by = run()
    assert (ended_by, probe.is_over) == (number, True)
    assert str(probe.error) == f"ended by {number.name}"


def test_a_second_signal_is_not_waited_for(link: FakeLink, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(probing, "Probe", Stubborn)
    _, number = run()
    assert number == signal.SIGINT
    assert link.sent[-2:] == [b"zero", b"hold"]


def test_nobody_is_driven_without_a_yes(monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.setattr("sys.stdin", Terminal("y\n"))
    with pytest.raises(UsageError, match="the answer was not yes"):
        command._confirm(0.3)
    monkeypatch.setattr("sys.stdin", Terminal("yes\n"))
    command._confirm(0.3)
    monkeypatch.setattr("sys.stdin", io.StringIO("yes\n"))
    with pytest.raises(UsageError, match="add --yes"):
        command._confirm(0.3)
