"""Over a restart a server signs no packet with a time that it had used, nor far ahead of its clock.

It has stored a time two minutes ahead: needed if its clock was set back, and of no use otherwise.
"""

from pathlib import Path

from mav_tasks.engine.inputs import KeysChanged, LinkChanged, LinkSide, WallClock
from mav_tasks.shell.in_memory import CLIENT_LINK
from tests.kit.cases import for_each
from tests.kit.client import FakeClient, heartbeat
from tests.kit.restarts import UTC, restart
from tests.kit.store import PromptSqliteStore
from tests.scenarios.conftest import MakeWorld
from tests.scenarios.test_signing import ALICE, put, signing

HOUR = 3600.0
SECOND = 100_000  # of a signature's time


def times(client: FakeClient) -> list[int]:
    """Return the times of signatures, in the order in which packets came."""
    return [int.from_bytes(packet.raw[-12:-6], "little") for packet in client.received]


@for_each("error, within", [(-HOUR, 130.0), (0.0, 5.0)])
def test_times_go_on(make_world: MakeWorld, tmp_path: Path, error: float, within: float) -> None:
    path = tmp_path / "tasks.sqlite3"
    world = put(make_world(store=PromptSqliteStore(path, wall_offset=UTC)), ALICE)
    client = signing(world, ALICE)
    world.run(3.0)
    before = len(client.received)
    restart(world, path, well=True, away=0.0, settles=0.0, utc=UTC + error)
    for change in (
        WallClock(UTC + error),
        KeysChanged((ALICE,)),
        LinkChanged(CLIENT_LINK, LinkSide.CLIENTS, up=False),
        LinkChanged(CLIENT_LINK, LinkSide.CLIENTS, up=True, takes_unsigned=False),
    ):
        world.server.pump.handle(change, now=world.now)
    client.send(heartbeat())
    world.run(3.0)
    assert len(client.received) > before + 10 > 20
    last, later = max(times(client)[:before]), times(client)[before:]
    assert last < min(later) <= max(later) < last + within * SECOND
