"""What the client library says before anybody has answered it, and how it ends."""

import asyncio
import socket
import threading
import time

import pytest

from mav_tasks import Client, Key, MavTasksError, NoAnswer, SyncClient
from mav_tasks.basics.errors import LinkDown
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.messages import Heartbeat
from mav_tasks.mavlink.signing import Signer, timestamp_at
from tests.kit.awaited import awaited
from tests.kit.processes import free_udp_ports

NOBODY = "udpout:127.0.0.1:9"
SOON = 5.0  # s on a very busy machine


@pytest.mark.parametrize("key", [b"", b"x" * 31, b"x" * 33, Key("revoked", b"")])
def test_what_is_no_key_is_refused(key: Key | bytes) -> None:
    for make in (lambda: Client(key=key), lambda: SyncClient(key=key).open()):
        with pytest.raises(ValueError, match="a key has 32 bytes"):
            make()
    secret = bytes(range(32))
    assert secret.hex() not in repr(Client(key=secret)) + repr(Key("anna", secret))


def test_links_of_servers_and_strange_link_ids_are_refused() -> None:
    with pytest.raises(MavTasksError, match="are for servers"):
        SyncClient(f"{NOBODY}?key=anna").open()
    for link_id in (-1, 256):
        with pytest.raises(ValueError, match=r"link_id .* not in 0\.\.255"):
            Client(NOBODY, key=bytes(range(32)), link_id=link_id)


def test_who_is_not_answered_is_told_what_the_link_brought() -> None:
    key, ours = Key("anna", bytes(range(32))), bytes(range(32))
    raw = Encoder(Address(1, 191)).encode(Heartbeat(18, 8, 0, 0, 4, 3))
    now = timestamp_at(time.time())
    (port,) = free_udp_ports(1)
    said = Signer(key, link_id=1)
    for packets, words in (
        ([], "does the server have key anna"),
        ([raw], "the received packets are not signed"),
        ([Signer(Key("ben", ours[::-1]), link_id=1).sign(raw, clock=now)], "signed with another"),
        ([said.sign(raw, clock=now - 10**8)], "signed for another time"),
        ([said.sign(raw, clock=now)] * 2, "signed for another time"),
    ):
        client = SyncClient(f"udpin:127.0.0.1:{port}", timeout=1.0, key=key)
        client.open()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for packet in packets:
                sender.sendto(packet, ("127.0.0.1", port))
        with pytest.raises(NoAnswer, match=words):
            client.found()
        client.close()


@awaited
async def test_a_connection_that_ends_is_named() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        client = Client(f"tcp:127.0.0.1:{listener.getsockname()[1]}", timeout=0.5)
        client.open()
        connection, _ = await asyncio.to_thread(listener.accept)
        await asyncio.to_thread(connection.recv, 1)  # more is left unread, which resets it
        connection.close()
    with pytest.raises(LinkDown, match=r"lost: Connection reset"):
        await client.found()
    await client.close()


def test_a_thread_that_waits_is_told_when_another_one_closes_and_no_thread_is_left() -> None:
    before = threading.active_count()
    client = SyncClient(NOBODY, timeout=60.0)
    client.open()
    with pytest.raises(MavTasksError, match="open already"):
        client.open()
    told: list[BaseException] = []
    begun = threading.Event()

    def wait() -> None:
        begun.set()
        try:
            client.found()
        except BaseException as error:  # noqa: BLE001 (whatever it is)
            told.append(error)

    thread = threading.Thread(target=wait, daemon=True)
    thread.start()
    begun.wait()
    client.close()
    client.close()
    thread.join(SOON)
    assert [isinstance(error, MavTasksError) for error in told] == [True]
    assert threading.active_count() == before
    with pytest.raises(MavTasksError, match="open it first"):
        client.stop()
