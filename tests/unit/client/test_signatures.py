"""What a client signs, and what it believes of what it hears; the other end is pymavlink."""

from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks import Client, Key, SyncClient
from mav_tasks.client.signatures import ClientSignatures
from mav_tasks.errors import LinkUrlError
from mav_tasks.mavlink.packet import Packet, split_datagram
from mav_tasks.mavlink.signing import stream_of, timestamp_at, timestamp_of

SECRET = bytes(range(32))
KEY = Key("anna", SECRET)
UTC = 1.8e9  # s
HEARTBEAT = bytes.fromhex("fd090000fa01bf0000000f0000000a03d10403deb7")


def only(raw: bytes) -> Packet:
    (packet,) = split_datagram(raw)
    return packet


class Server:
    """Signs, and verifies, as pymavlink does."""

    def __init__(self, secret: bytes | None = SECRET, *, utc: float = UTC) -> None:
        self.mav = common.MAVLink(None, srcSystem=1, srcComponent=191)
        if secret is not None:
            self.mav.signing.secret_key, self.mav.signing.sign_outgoing = secret, True
            self.mav.signing.timestamp = timestamp_at(utc)

    def says(self, *, radio: bool = False) -> Packet:
        """Return a packet of its."""
        message: Any = common.MAVLink_heartbeat_message(10, 3, 0, 0, 4, 3)
        if radio:
            message = common.MAVLink_radio_status_message(1, 2, 3, 4, 5, 6, 7)
        return only(message.pack(self.mav))

    def believes(self, raw: bytes) -> bool:
        """Whether pymavlink does."""
        self.mav.robust_parsing = True
        messages = self.mav.parse_buffer(raw)
        return [message.get_type() for message in messages] == ["HEARTBEAT"]


def test_pymavlink_believes_what_is_signed_each_packet_once() -> None:
    signatures, server = ClientSignatures(KEY), Server(utc=UTC - 10.0)
    packets = [signatures.sealed(HEARTBEAT, utc=UTC) for _ in range(5)]
    assert all(map(server.believes, packets))
    assert not server.believes(packets[0])
    assert not Server(b"x" * 32).believes(packets[4])


def test_what_the_server_has_signed_is_believed_each_packet_once() -> None:
    signatures, server = ClientSignatures(KEY), Server()
    heard = [server.says() for _ in range(5)]
    assert all(signatures.believes(packet, utc=UTC) for packet in heard)
    assert not signatures.believes(heard[4], utc=UTC)
    assert signatures.not_believed.old == 1


@pytest.mark.parametrize(
    ("server", "words"),
    [
        (Server(None), "the received packets are not signed: does the server have key anna ("),
        (Server(b"x" * 32), "the received packets are signed with another key than anna ("),
        (
            Server(utc=UTC - 3600.0),
            "the received packets are signed for another time: are both clocks",
        ),
    ],
    ids=["unsigned", "another key", "an hour ago"],
)
def test_other_packets_are_not_believed_and_it_is_told_why(server: Server, words: str) -> None:
    signatures = ClientSignatures(KEY)
    assert not signatures.believes(server.says(), utc=UTC)
    assert words in signatures.why_silent()


def test_silence_has_words_too() -> None:
    assert ClientSignatures(KEY).why_silent() == (
        f"does the server have key anna ({KEY.fingerprint}), and are both clocks right?"
    )


def test_radios_may_speak_unsigned() -> None:
    signatures = ClientSignatures(KEY)
    assert signatures.believes(Server(None).says(radio=True), utc=UTC)


def test_of_two_clients_neither_makes_the_other_old() -> None:
    """Though they have one key and one address, they are two streams, nearly always."""
    streams = {
        stream_of(only(ClientSignatures(KEY).sealed(HEARTBEAT, utc=UTC))).link_id for _ in range(50)
    }
    assert len(streams) > 10
    own = ClientSignatures(KEY, link_id=255)
    assert stream_of(only(own.sealed(HEARTBEAT, utc=UTC))).link_id == 255


def test_one_run_goes_on_after_the_other_by_the_clock() -> None:
    one, two = (ClientSignatures(KEY, link_id=1) for _ in range(2))
    times = [
        timestamp_of(only(signatures.sealed(HEARTBEAT, utc=utc)))
        for signatures, utc in ((one, UTC), (one, UTC), (two, UTC + 1e-3), (two, UTC - 9.0))
    ]
    assert times == sorted(set(times))


def test_a_server_that_is_ahead_leads_nobody_away_from_his_clock() -> None:
    signatures = ClientSignatures(KEY)
    assert signatures.believes(Server(utc=UTC + 50.0).says(), utc=UTC)
    sealed = only(signatures.sealed(HEARTBEAT, utc=UTC))
    assert timestamp_of(sealed) == timestamp_at(UTC)


@pytest.mark.parametrize("key", [b"", b"x" * 31, b"x" * 33, Key("revoked", b"")])
def test_what_is_no_key_is_refused(key: Key | bytes) -> None:
    for make in (lambda: Client(key=key), lambda: SyncClient(key=key).open()):
        with pytest.raises(ValueError, match="a key has 32 bytes"):
            make()


@pytest.mark.parametrize("link_id", [-1, 256])
def test_a_link_id_is_a_byte(link_id: int) -> None:
    with pytest.raises(ValueError, match=r"link_id .* not in 0\.\.255"):
        Client("udpout:127.0.0.1:1", key=SECRET, link_id=link_id)


def test_what_a_server_s_url_says_of_signatures_is_none_of_a_client_s() -> None:
    client = SyncClient("udpout:127.0.0.1:1?key=anna")
    with pytest.raises(LinkUrlError, match="are for servers"):
        client.open()


def test_no_repr_has_the_secret() -> None:
    assert SECRET.hex() not in repr(ClientSignatures(SECRET))
    assert repr(SECRET) not in repr(ClientSignatures(KEY))
