"""A rover that signs, and hears only what is signed: driven, recorded, and left without its key."""

from pathlib import Path

from pymavlink.dialects.v20 import common

from mav_tasks.engine.inputs import KeysChanged, LinkChanged, LinkSide, Packets
from mav_tasks.links.policy import LinkPolicy
from mav_tasks.mavlink.packet import split_datagram
from mav_tasks.mavlink.signing import Key, is_signed_with
from mav_tasks.shell.in_memory import VEHICLE_LINK
from mav_tasks.tasks.events import VehicleNoted
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import Faults
from rover_sim.personas import Mode
from tests.kit.cases import for_each
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

UTC = 1.8e9  # s, when the worlds begin
ROVERS, OTHER = Key("rovers", bytes(range(32))), Key("other", bytes(range(1, 33)))
REVOKED = Key("rovers", b"", fingerprint=ROVERS.fingerprint)
SETPOINT = 84


def signed_world(make_world: MakeWorld, *, records: Path | None = None) -> World:
    return make_world(
        keys=(ROVERS, OTHER),
        policies={VEHICLE_LINK: LinkPolicy(takes_unsigned=False, key="rovers")},
        wall_offset=UTC,
        rover_key=ROVERS,
        records=records,
    )


def sent_to_rover(world: World) -> list[bytes]:
    """Return the list that all packets to the first rover are noted in from now on."""
    return world.overheard(
        lambda source, target, _data: (source, target) == (VEHICLE_LINK, "rover1")
    )


def test_all_that_drives_it_is_signed_with_its_key(make_world: MakeWorld) -> None:
    world = signed_world(make_world)
    sent = sent_to_rover(world)
    sent_move = world.client.move(1.0)
    world.until_idle(tasks=1)
    assert world.state(sent_move.task_id)[0] is S.COMPLETED
    packets = [packet for data in sent for packet in split_datagram(data)]
    assert sum(packet.message_id == SETPOINT for packet in packets) > 20
    assert all(packet.is_signed and is_signed_with(packet, ROVERS.secret) for packet in packets)


@for_each("forged", ["unsigned", "another key"])
def test_nobody_else_is_taken_for_it(make_world: MakeWorld, forged: str) -> None:
    """Neither who pretends to be armed and elsewhere, nor who knows a key of clients."""
    world = signed_world(make_world)
    before = world.server.engine.snapshot(now=world.now).vehicles
    stranger = world.add_client("stranger", system_id=1, component_id=1)
    stranger.heartbeats = False
    if forged == "another key":
        stranger.sign(OTHER.secret, utc=UTC + world.now)
    for _ in range(5):
        world.from_vehicle_side(stranger.packed(armed_heartbeat()))
        world.run(0.2)
    assert world.server.engine.snapshot(now=world.now).vehicles == before
    counts = world.server.engine.signatures.counts
    assert (counts.unsigned, counts.unverified) == ((5, 0) if forged == "unsigned" else (0, 5))


def armed_heartbeat() -> object:
    return common.MAVLink_heartbeat_message(10, 3, 1 | 128, 15, 4, 3)


def test_a_rover_that_signs_does_not_come_back_where_nobody_signs(make_world: MakeWorld) -> None:
    """Or else a STOP would go to whoever says, unsigned, that he is it."""
    world = signed_world(make_world)
    server = world.server
    server.pump.handle(LinkChanged("open", LinkSide.VEHICLES, up=True), now=world.now)
    world.fault(Faults(silent=True))
    world.run(10.0)
    beat = armed_heartbeat().pack(common.MAVLink(None, 1, 1))  # type: ignore[attr-defined]
    for _ in range(5):
        server.pump.handle(Packets("open", [("somebody", beat)]), now=world.now)
        world.run(1.0)
    (vehicle,) = server.engine.snapshot(now=world.now).vehicles
    assert not vehicle.heard
    assert any("has no key" in event.text for event in world.events(VehicleNoted))
    world.fault(Faults())
    world.run(3.0)
    assert server.engine.snapshot(now=world.now).vehicles[0].heard


def test_without_its_key_it_is_lost_and_stands(make_world: MakeWorld) -> None:
    world = signed_world(make_world)
    move = world.client.move(30.0)
    world.until_faster(0.3)
    world.server.pump.handle(KeysChanged((REVOKED, OTHER)), now=world.now)
    world.server.pump.turn(now=world.now)
    world.until(world.stands, within=10)
    world.until(lambda: world.state(move.task_id)[0] is not S.EXECUTING, within=10)
    assert world.state(move.task_id)[1] in (R.LINK_LOST, R.POSITION_LOST)
    world.run(3.0)
    assert world.stands()


def test_a_stop_reaches_it_though_its_key_was_revoked(make_world: MakeWorld) -> None:
    """It is not believed any more; but it hears nobody else, and must not be left driving."""
    world = signed_world(make_world)
    world.client.move(30.0)
    world.until_faster(0.3)
    world.server.pump.handle(KeysChanged((REVOKED, OTHER)), now=world.now)
    world.client.stop()
    world.until(lambda: world.mode() is Mode.HOLD, within=1.0)
    world.until(world.stands, within=2.0)
