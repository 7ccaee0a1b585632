"""Signed clients, as pymavlink signs: who is believed, what is signed to them, what is no news."""

from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Settings, Signing
from mav_tasks.engine.inputs import KeysChanged, LinkChanged, LinkSide, SettingsChanged, WallClock
from mav_tasks.mavlink.signing import Key
from mav_tasks.shell.in_memory import CLIENT_LINK
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, MOVE, FakeClient, Received, command_long
from tests.kit.restarts import UTC, restart
from tests.kit.rows import check
from tests.kit.store import PromptSqliteStore
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

ALICE = Key("alice", bytes(range(32)), "operator")
BOB = Key("bob", bytes(range(1, 33)), "safety")
REVOKED = Key("alice", b"", "operator", ALICE.fingerprint)
ROVERS = Key("rovers", bytes(range(2, 34)))
MINUTE = 60.0
COMMAND_LONG = 76


def put(world: World, *keys: Key, takes_unsigned: bool = False, setup: str = "known") -> World:
    """Return a server its keys, and its link for clients a policy."""
    server, now = world.server, world.now
    settings = Settings(signing=Signing(setup=setup))
    if settings != Settings():
        server.pump.handle(SettingsChanged(settings), now=now)
    server.pump.handle(WallClock(UTC), now=now)
    server.pump.handle(KeysChanged(keys), now=now)
    server.pump.handle(LinkChanged(CLIENT_LINK, LinkSide.CLIENTS, up=False), now=now)
    change = LinkChanged(CLIENT_LINK, LinkSide.CLIENTS, up=True, takes_unsigned=takes_unsigned)
    server.pump.handle(change, now=now)
    server.pump.turn(now=now)
    return world


def signing(world: World, key: Key, *, behind: float = 0.0, name: str = "signer") -> FakeClient:
    client = world.add_client(name)
    client.sign(key.secret, utc=UTC + world.now - behind)
    return client


def counts(world: World) -> tuple[int, int, int]:
    """Return the packets refused: unsigned, of no key, and old."""
    found = world.server.engine.signatures.counts
    return found.unsigned, found.unverified, found.old


def believes_all(client: FakeClient) -> bool:
    """Whether a client has heard the server, and taken all of it."""
    return client.verified > 10 and not client.disbelieved


@for_each("link_id", [0, 1, 255])
def test_a_signed_command_is_done_and_all_that_comes_back_is_signed(
    world: World, link_id: int
) -> None:
    put(world, ALICE)
    client = world.add_client("signer")
    client.sign(ALICE.secret, utc=UTC + world.now, link_id=link_id)
    world.run(1.5)
    sent = client.move(1.0)
    world.until_idle(tasks=1)
    assert world.state(sent.task_id)[0] is S.COMPLETED
    assert world.task(sent.task_id).submitter.key == "alice"
    assert str(world.task(sent.task_id).submitter).endswith(" signed alice")
    assert client.verified > 100
    assert not client.disbelieved


def test_where_signatures_are_asked_for_nothing_else_is_looked_at(world: World) -> None:
    put(world, ALICE)
    stranger = signing(world, BOB, name="stranger")
    sent = [world.client.move(1.0), stranger.move(1.0), stranger.pause(), world.client.pause()]
    world.run(2.0)
    assert [each.ack for each in sent] == [None] * 4
    assert world.tasks() == ()
    unsigned, unknown, old = counts(world)
    assert (unsigned >= 3, unknown >= 3, old) == (True, True, 0)
    assert not stranger.received


def test_where_they_are_not_asked_for_a_wrong_one_is_worse_than_none(world: World) -> None:
    put(world, ALICE, takes_unsigned=True)
    wrong = signing(world, BOB, name="wrong")
    check(world, "wrong> TASK_MOVE 1 : -\nTASK_MOVE 1 : ACCEPTED", wrong=wrong)


def test_without_a_key_ring_signatures_are_taken_off(world: World) -> None:
    signing(world, ALICE).move(1.0)
    world.run(0.2)
    assert [task.submitter.key for task in world.tasks()] == [""]


def test_the_key_of_rovers_is_no_client_s(world: World) -> None:
    put(world, ALICE, ROVERS)
    check(world, "rover> PAUSE : -", rover=signing(world, ROVERS))
    assert counts(world)[1] >= 1


@for_each("place", [8, 20, -13, -10, -1])
def test_a_packet_that_was_changed_is_nobody_s(world: World, place: int) -> None:
    put(world, ALICE)
    client = signing(world, ALICE)
    world.run(0.1)
    raw = bytearray(client.packed(command_long(MOVE, *[1.0] * 7)))
    raw[place] ^= 1
    if place >= 0:  # who can change a packet can make its CRC right
        crc = common.x25crc(raw[1:-15] + bytes([152])).crc  # COMMAND_LONG's CRC_EXTRA
        raw[-15:-13] = crc.to_bytes(2, "little")
    client.send_raw(bytes(raw))
    world.run(0.2)
    assert world.tasks() == ()


def recorded(world: World, client: FakeClient) -> tuple[bytes, int]:
    """Have a task submitted, and give the very bytes that did it, with its id."""
    sent = world.overheard(
        lambda source, _target, data: source == client.name and data[7] == COMMAND_LONG
    )
    command = client.move(1.0)
    world.until_idle(tasks=1)
    return sent[-1], command.task_id


def test_a_replayed_command_is_not_done_again(world: World) -> None:
    put(world, ALICE)
    client = signing(world, ALICE)
    raw, _ = recorded(world, client)
    attacker = world.add_client("attacker")
    attacker.heartbeats = False
    for seconds in (0.0, 10.0, 120.0):  # long after the server has forgotten what it looked like
        world.run(seconds)
        for who in (client, attacker):
            who.send_raw(raw)
    world.run(1.0)
    assert len(world.tasks()) == 1
    assert counts(world)[2] == 6
    assert not attacker.received


@pytest.fixture
def kept(make_world: MakeWorld, path: Path) -> World:
    """Return a world whose server keeps everything on a disk."""
    return make_world(store=PromptSqliteStore(path, wall_offset=UTC))


@pytest.mark.parametrize("well", [True, False])
def test_nor_by_a_server_that_was_started_since(kept: World, path: Path, well: bool) -> None:
    world = put(kept, ALICE)
    client = signing(world, ALICE)
    raw, task = recorded(world, client)
    restart(world, path, well=well, away=3.0, settles=0.0)
    put(world, ALICE)
    world.run(2.5)
    attacker = world.add_client("attacker")
    attacker.heartbeats = False
    attacker.send_raw(raw)
    world.run(0.3)
    assert [each.id for each in world.tasks()] == [task]
    assert counts(world)[2] == 1
    again = client.move(0.5)  # whose time goes on
    world.run(0.3)
    assert again.task_id == task + 1


def test_a_sender_heard_for_the_first_time_may_be_a_minute_behind(world: World) -> None:
    put(world, ALICE, BOB)
    check(
        world,
        "late> TASK_MOVE 1 : ACCEPTED\nlater> TASK_MOVE 1 : -",
        late=signing(world, ALICE, behind=MINUTE - 1.0, name="late"),
        later=signing(world, BOB, behind=MINUTE + 2.0, name="later"),
    )
    assert counts(world)[2] >= 1


def test_a_sender_who_is_ahead_is_answered_in_his_own_time(world: World) -> None:
    """Or else he would take the answers for old ones. Nobody else's time is changed by him."""
    put(world, ALICE, BOB)
    ahead = signing(world, ALICE, behind=1.0 - MINUTE, name="ahead")
    other = signing(world, BOB, name="other")
    world.run(1.0)
    sent = ahead.move(1.0), other.move(2.0)
    world.run(0.3)
    assert [each.result for each in sent] == [ACCEPTED] * 2
    for client in (ahead, other):
        assert believes_all(client)


def test_a_revoked_key_is_nobody_s_at_once(world: World) -> None:
    put(world, ALICE, BOB)
    client, other = signing(world, ALICE), signing(world, BOB, name="other")
    world.run(1.5)
    assert client.heard("HEARTBEAT")
    world.server.pump.handle(KeysChanged((REVOKED, BOB)), now=world.now)
    heard = len(client.received)
    sent = [client.move(1.0), client.pause(), other.move(2.0)]
    world.run(1.0)
    assert [each.ack is not None for each in sent] == [False, False, True]
    assert [task.submitter.key for task in world.tasks()] == ["bob"]
    assert len(client.received) - heard <= 2, "what was on its way"


def test_a_revoked_key_is_not_taken_for_no_signature(world: World) -> None:
    put(world, REVOKED, takes_unsigned=True)
    check(world, "alice> TASK_MOVE 1 : -", alice=signing(world, ALICE))


def setup_message(secret: bytes) -> object:
    return common.MAVLink_setup_signing_message(1, 1, list(secret), 0)


def is_signed(packet: Received) -> bool:
    return bool(packet.raw[2] & 1)


def test_setup_signing_with_a_known_key_has_the_server_sign(world: World) -> None:
    """As QGroundControl's button: it waits 5 s for a signed heartbeat."""
    put(world, ALICE, takes_unsigned=True)
    world.run(1.5)
    assert not any(map(is_signed, world.client.received))
    world.client.send(setup_message(ALICE.secret))
    world.client.received.clear()
    world.run(1.5)
    beats = [p for p in world.client.received if p.message_id == 0]
    assert beats
    assert all(map(is_signed, beats))
    world.client.send(setup_message(bytes(32)))
    world.run(0.1)
    world.client.received.clear()
    world.run(1.5)
    assert not any(map(is_signed, world.client.received))


@for_each(
    "secret, setup, words",
    [
        (BOB.secret, "known", "signing refused: this server has no such key for clients"),
        (ROVERS.secret, "known", "signing refused: this server has no such key for clients"),
        (ALICE.secret, "refuse", "signing refused: disabled by signing.setup"),
    ],
)
def test_setup_signing_brings_no_key_in(
    world: World, secret: bytes, setup: str, words: str
) -> None:
    put(world, ALICE, ROVERS, takes_unsigned=True, setup=setup)
    world.run(1.5)
    world.client.send(setup_message(secret))
    world.run(1.5)
    assert words in world.client.texts()
    assert not any(map(is_signed, world.client.received))


def test_signing_is_not_ended_where_it_is_asked_for(world: World) -> None:
    put(world, ALICE)
    client = signing(world, ALICE)
    world.run(1.5)
    client.send(setup_message(bytes(32)))
    client.received.clear()
    world.run(1.5)
    assert client.received
    assert all(map(is_signed, client.received))
