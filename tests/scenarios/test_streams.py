"""Links whose bytes are cut anywhere, with peers that come and go: in virtual time."""

from collections import Counter
from itertools import pairwise
from random import Random

import pytest

from mav_tasks.engine.inputs import (
    Congestion,
    Input,
    LinkChanged,
    LinkSide,
    PeerChanged,
)
from mav_tasks.shell.in_memory import CLIENT_LINK, VEHICLE_LINK
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.cases import anew
from tests.kit.client import ACCEPTED, GUIDED, REQUEST, SET_INTERVAL, FakeClient, setpoint
from tests.kit.mission import Item, Upload
from tests.kit.world import COMMAND_ID, MODE_COMMAND, Outputs, World, at, near_pose
from tests.scenarios.conftest import MakeWorld

SEED = 31


SET_MODE = 176  # the command
ATTITUDE, POSITION, HEARTBEAT = 30, 32, 0


def tell(world: World, item: Input) -> None:
    """Let the server know something as its links would tell it."""
    world.server.pump.handle(item, now=world.now)
    world.server.pump.turn(now=world.now)


@anew
def streams(make_world: MakeWorld, outputs: Outputs) -> World:
    """Return a world in which both links of the server are streams, cut anywhere."""
    world, random = make_world(outputs=outputs), Random(SEED)

    def cut(link: str, data: bytes) -> list[bytes]:
        count = random.randrange(4) if link.startswith("server:") else 0
        edges = sorted({0, len(data), *random.choices(range(len(data)), k=count)})
        return [data[a:b] for a, b in pairwise(edges)]

    world.watched.cut_up = cut
    for name, side, peer in (
        (VEHICLE_LINK, LinkSide.VEHICLES, "rover1"),
        (CLIENT_LINK, LinkSide.CLIENTS, "client"),
    ):
        tell(world, LinkChanged(name, side, up=True, is_stream=True))
        tell(world, PeerChanged(name, peer, up=True))
    world.run(1.5)
    return world


@anew
def outputs() -> Outputs:
    """Return what collects what leaves the server."""
    return Outputs()


def gaps(client: FakeClient, since: float) -> int:
    """Losses that a client sees from a moment on."""
    client.received = [packet for packet in client.received if packet.at >= since]
    return client.gaps((1, 1)) + client.gaps((1, 191))


def test_tasks_and_plans_are_the_same_over_streams(streams: World) -> None:
    world, since = streams, streams.now
    moves = [world.client.move(0.5), world.client.rotate(90)]
    plan = Upload(world.client, [Item(16, **at(1.0, 0.0)), Item(16, **at(1.0, 1.0))])
    world.client.roles.append(plan)
    world.until(lambda: plan.result is not None, within=5)
    world.until(lambda: world.state(2)[0] is S.COMPLETED, within=30)
    assert [sent.answer for sent in moves] == [(ACCEPTED, 1), (ACCEPTED, 2)]
    assert plan.result == 0
    assert near_pose(world.pose(), (0.5, 0.0, 90.0))
    assert gaps(world.client, since) == 0


def test_who_drove_and_is_gone_leaves_no_velocity_behind_and_must_ask_again(
    streams: World,
) -> None:
    world = streams
    world.client.mode(GUIDED)
    world.run(0.5)
    world.client.arm(True)
    world.run(0.5)
    world.client.stream(setpoint(0.5), rate=20)
    world.run(3)
    assert world.truth.forward_speed > 0.4
    world.client.end_streams()
    tell(world, PeerChanged(CLIENT_LINK, "client", up=False))
    world.run(1.5)
    assert world.stands()
    tell(world, PeerChanged(CLIENT_LINK, "client", up=True))
    world.client.stream(setpoint(0.5), rate=20)
    world.run(2)
    assert world.stands()
    world.client.mode(GUIDED)
    world.run(2)
    assert world.truth.forward_speed > 0.4


def test_stop_asks_for_hold_ahead_of_all_that_waits_for_the_way_out(
    streams: World, outputs: Outputs
) -> None:
    world = streams
    world.client.move(3)
    world.until_state(1, S.EXECUTING)
    world.run(1)
    assert not any(outgoing.is_first for _, outgoing in outputs.sent)
    world.client.stop()
    world.until(world.stands, within=3)
    firsts = [outgoing for _, outgoing in outputs.sent if outgoing.is_first]
    assert firsts[0].data[COMMAND_ID] == SET_MODE.to_bytes(2, "little")
    assert {outgoing.data[7] for outgoing in firsts} == {MODE_COMMAND}


def test_a_congested_client_gets_answers_and_no_telemetry_and_the_other_all(
    streams: World,
) -> None:
    world = streams
    other = world.add_client("other", system_id=245)
    tell(world, PeerChanged(CLIENT_LINK, "other", up=True))
    world.run(2)
    since = world.now
    tell(world, Congestion(CLIENT_LINK, "client", is_congested=True))
    sent = [world.client.command(REQUEST, 148, target=(1, 1)), world.client.move(0.3)]
    world.until_idle(tasks=1)
    took = world.now - since
    assert [s.result for s in sent] == [ACCEPTED, ACCEPTED]
    assert sent[1].acked_at - sent[1].at < 0.1
    came = [p for p in world.client.received if p.at > since]
    ids = {p.message_id for p in came}
    assert not ids & {ATTITUDE, POSITION}
    assert sum(p.message_id == HEARTBEAT for p in came) >= 2 * int(took) - 1
    assert "Task 1 done" in world.client.texts()
    assert sum(p.at > since for p in other.of_id(ATTITUDE)) > 9 * took

    tell(world, Congestion(CLIENT_LINK, "client", is_congested=False))
    world.run(60)
    at_last = world.now
    world.run(5)
    attitudes = sum(p.at > at_last for p in world.client.of_id(ATTITUDE))
    assert attitudes == pytest.approx(50, abs=3)
    assert gaps(world.client, since) == 0


def test_wishes_for_everything_are_stretched_by_what_the_line_takes(streams: World) -> None:
    """Twenty times, less as time goes by, and each stream by a little more or less than others."""
    world = streams
    for message_id in (ATTITUDE, POSITION):
        world.client.command(SET_INTERVAL, message_id, 1, target=(1, 1))
    world.run(2)
    for is_congested in (True, False) * 10:
        tell(world, Congestion(CLIENT_LINK, "client", is_congested=is_congested))
    since = world.now
    world.run(10)
    came = Counter(p.message_id for p in world.client.received if p.at > since)
    assert [came[ATTITUDE], came[POSITION]] == pytest.approx([32, 29], abs=1)


def test_noise_on_a_line_costs_no_more_than_what_it_hit(streams: World) -> None:
    world, random = streams, Random(SEED)
    world.client.move(1)
    for _ in range(200):
        world.client.send_raw(random.randbytes(random.randrange(1, 40)))
        world.from_vehicle_side(random.randbytes(random.randrange(1, 40)), peer="rover1")
        world.run(0.05)
    world.until_idle(tasks=1)
    assert world.state(1)[0] is S.COMPLETED
