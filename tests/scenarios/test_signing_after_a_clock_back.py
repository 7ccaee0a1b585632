"""A server whose clock was set back over a restart signs no packet with a time that it had used."""

from pathlib import Path

from mav_tasks.engine.inputs import KeysChanged, LinkChanged, LinkSide, WallClock
from mav_tasks.in_memory import CLIENT_LINK
from tests.kit.client import FakeClient, heartbeat
from tests.kit.restarts import UTC, restart
from tests.kit.store import PromptSqliteStore
from tests.scenarios.conftest import MakeWorld
from tests.scenarios.test_signing import ALICE, put, signing

HOUR = 3600.0


def times(client: FakeClient) -> list[int]:
    """Return the times of signatures, in the order in which packets came."""
    return [int.from_bytes(packet.raw[-12:-6], "little") for packet in client.received]


def test_times_go_on(make_world: MakeWorld, tmp_path: Path) -> None:
    path = tmp_path / "tasks.sqlite3"
    world = put(make_world(store=PromptSqliteStore(path, wall_offset=UTC)), ALICE)
    client = signing(world, ALICE)
    world.run(3.0)
    before = len(client.received)
    restart(world, path, well=True, away=0.0, settles=0.0, utc=UTC - HOUR)
    for change in (
        WallClock(UTC - HOUR),
        KeysChanged((ALICE,)),
        LinkChanged(CLIENT_LINK, LinkSide.CLIENTS, up=False),
        LinkChanged(CLIENT_LINK, LinkSide.CLIENTS, up=True, takes_unsigned=False),
    ):
        world.server.pump.handle(change, now=world.now)
    client.send(heartbeat())
    world.run(3.0)
    assert len(client.received) > before + 10 > 20
    assert min(times(client)[before:]) > max(times(client)[:before])
