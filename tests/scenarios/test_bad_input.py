"""Bytes from outside change nothing unless they are meant, and never raise."""

import re
import struct
from dataclasses import replace
from math import inf, nan
from random import Random

from pymavlink.dialects.v20 import common

from mav_tasks.engine.snapshot import Snapshot
from mav_tasks.in_memory import CLIENT_LINK, VEHICLE_LINK
from mav_tasks.settings import Clients, Settings
from mav_tasks.tasks.events import VehicleNoted
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import Faults
from tests.kit.cases import for_each
from tests.kit.client import (
    ACCEPTED,
    DENIED,
    MOVE,
    ROTATE,
    command_long,
    heartbeat,
    setpoint,
    sticks,
)
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

STRANGERS = 500.0  # datagrams a second that the server looks at, of all that are no clients


def state_of(world: World) -> Snapshot:
    """Return everything but the counts of what came in."""
    return replace(world.server.engine.snapshot(now=world.now), decoded="")


def counts(world: World, link: str) -> dict[str, int]:
    """Return what the server has counted on one side, by kind."""
    on_vehicles, on_clients = world.server.engine.snapshot(now=world.now).decoded.split(", clients")
    counted = on_clients if link == CLIENT_LINK else on_vehicles
    return {kind: int(number) for kind, number in re.findall(r"(\w+)=(\d+)", counted)}


def looks_whole(data: bytes) -> bool:
    """Whether both sides read a datagram as a packet of a kind that they make use of."""
    return (
        len(data) > 12
        and (data[0], len(data)) == (0xFD, 12 + data[1])
        and int.from_bytes(data[7:10], "little") in (0, 30, 32, 84)
    )


def good_packets(random: Random) -> list[bytes]:
    """Return packets that would do something if they were whole."""
    mav = common.MAVLink(None, random.choice((1, 250, 255, 9)), random.choice((1, 191, 190)))
    mav.seq = random.randrange(256)
    messages = [
        heartbeat(),
        setpoint(1.0),
        sticks(500),
        command_long(MOVE, 1.0),
        command_long(54003),
        command_long(400, 1, target=(1, 1)),
        common.MAVLink_set_mode_message(1, 1, 10),
        common.MAVLink_local_position_ned_message(1, 100, 100, 0, 0, 0, 0),
        common.MAVLink_attitude_message(1, 0, 0, 3, 0, 0, 0),
        common.MAVLink_heartbeat_message(10, 3, 129, 10, 4, 3),
    ]
    return [message.pack(mav) for message in messages]


def garbage(random: Random) -> bytes:
    """Return a datagram that means nothing: noise, cut off, flipped, or of an unknown id."""
    packet = bytearray(random.choice(good_packets(random)))
    match random.randrange(5):
        case 0:
            return random.randbytes(random.randrange(1, 300))
        case 1:
            return bytes(packet[: random.randrange(1, len(packet))])
        case 2:
            packet[random.randrange(10, len(packet))] ^= 1 << random.randrange(8)
            return bytes(packet)
        case 3:
            head = bytes((random.choice((0xFD, 0xFE)), random.randrange(256)))
            return head + random.randbytes(random.randrange(0, 290))
        case _:
            packet[7:10] = struct.pack("<I", random.randrange(60_000, 1 << 24))[:3]
            return bytes(packet)


@for_each("link", [CLIENT_LINK, VEHICLE_LINK])
def test_10000_bad_datagrams_change_nothing_and_are_counted(
    make_world: MakeWorld, link: str
) -> None:
    world = make_world(settings=Settings(clients=Clients(packet_rate=1e6)))  # all is looked at
    world.client.pause()
    world.run(0.1)
    world.client.move(1)
    world.run(0.1)
    seed = 1  # of noise, one in 65,536 has a good CRC; not of this one
    random = Random(seed)
    print("seed", seed)
    known = {CLIENT_LINK: "client", VEHICLE_LINK: "rover1"}[link]
    before, counted = state_of(world), counts(world, link)
    flipped = broken = 0
    for _ in range(10_000):
        data = garbage(random)
        flipped += looks_whole(data)
        broken += data[0] not in (0xFD, 0xFE)
        # of strangers on a client link not more are looked at than in a second
        who = "stranger" if random.random() < STRANGERS / 60_000 else known
        world.net.send(who, link, data)
    world.run(0.01)
    assert state_of(world) == before
    more = {kind: number - counted[kind] for kind, number in counts(world, link).items()}
    assert more["noise"] >= broken + flipped
    assert min(broken, flipped) > 500
    assert more["unknown"] > 0
    assert world.rover.autopilot.armed is False


@for_each("seed", range(4))
def test_valid_packets_full_of_nonsense_raise_nothing(world: World, seed: int) -> None:
    """Every message of the base set, with random contents and a good CRC, on both sides."""
    random = Random(seed)
    print("seed", seed)
    world.observer.expects_gaps = True
    for message_id, kind in common.mavlink_map.items():
        size = kind.unpacker.size
        for _ in range(3):
            payload = random.randbytes(size)
            for link, peer, source in (
                (CLIENT_LINK, "nonsense", (random.randrange(256), random.randrange(256))),
                (VEHICLE_LINK, "elsewhere", (random.randrange(2, 250), 1)),
            ):
                world.net.send(peer, link, whole(message_id, kind.crc_extra, payload, source))
        world.run(0.001)
    for command in range(0, 65536, 97):
        values = [random.choice((nan, inf, -inf, -1.0, 0.0, 1e30, 3.0)) for _ in range(7)]
        world.net.send("client", CLIENT_LINK, packed(command_long(command, *values)))
    world.run(1)
    world.watched.observers.clear()  # the rover was driven about by these; no rule was meant


OURS = (54000, 54001, 54003, 193, 176, 400, 510, 511, 512, 20, 192, 300)


@for_each("command", OURS)
@for_each("component", [0, 1, 191])
def test_no_number_in_a_command_raises(world: World, command: int, component: int) -> None:
    odd = (nan, inf, -inf, -1.0, 1e30, -1e30, 0.5, 65536.0, 54000.0, 2.0**31, 2.0**63)
    for index in range(7):
        for value in odd:
            params = [0.0] * 7
            params[index] = value
            if command in (510, 511, 512) and index:
                params[0] = 54000.0
            world.client.send(command_long(command, *params, target=(1, component)))
    for x in (-(2**31), 2**31 - 1):
        world.client.command_int(command, nan, x=x, y=x, z=nan, frame=255, target=(1, component))
    world.run(2)
    world.watched.observers.clear()  # the rover was driven about by these; no rule was meant


LIMITS = {
    MOVE: {1: ("distance", 10_000.5), 2: ("speed", 2.01)},
    ROTATE: {1: ("angle", 3601.0), 2: ("rate", 90.1)},
}
COMMON = {4: ("nonce", 2.0**24), 7: ("priority", 10.5)}
CASES = [
    (command, index, name, value)
    for command, own in LIMITS.items()
    for index, (name, over) in (own | COMMON).items()
    for value in (inf, -inf, over, -over, nan)
    if not (value != value and index != 1)  # NaN means "not given" wherever there is a default
]


@for_each("form", ["LONG", "INT"])
@for_each("command, index, name, value", CASES)
def test_a_bad_parameter_is_denied_and_named(
    world: World, form: str, command: int, index: int, name: str, value: float
) -> None:
    params = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 5.0]
    params[index - 1] = value
    if form == "LONG":
        sent = world.client.command(command, *params)
    else:
        sent = world.client.command_int(command, *params[:4], z=params[6])
    world.run(0.1)
    assert sent.answer == (DENIED, R.BAD_PARAMETER)
    assert world.client.texts()[-1].startswith(f"param{index} {name} ")
    assert world.tasks() == ()


@for_each("command", [MOVE, ROTATE])
def test_nan_is_not_given_and_zero_is_nothing_to_do(world: World, command: int) -> None:
    given = world.client.command(command, 1.0, nan, nan, nan, nan, nan, nan)
    world.run(0.1)
    nothing = world.client.command(command, 0.0)
    world.run(0.1)
    assert (given.answer, nothing.answer) == ((ACCEPTED, 1), (DENIED, R.BAD_PARAMETER))
    assert world.task(1).priority == 5


def test_unverified_bytes_of_our_own_address_are_no_second_server(world: World) -> None:
    world.client.move(2)
    world.until_state(1, S.EXECUTING)
    forged = bytearray(packed(setpoint(1.0), 250, 191))
    forged[-1] ^= 0xFF
    unknown = bytes((0xFD, 1, 0, 0, 0, 250, 191, 0x11, 0x27, 0)) + b"x" + b"\0\0"
    world.from_vehicle_side(bytes(forged))
    world.from_vehicle_side(unknown)
    world.run(0.5)
    assert world.state(1)[0] is S.EXECUTING


def test_unverified_bytes_do_not_move_a_silent_rover_to_another_endpoint(world: World) -> None:
    world.fault(Faults(silent=True))
    world.run(5)
    forged = bytearray(packed(heartbeat(), 1, 1))
    forged[-1] ^= 0xFF
    world.from_vehicle_side(bytes(forged), peer="thief")
    unknown = bytes((0xFD, 1, 0, 0, 0, 1, 1, 0x11, 0x27, 0)) + b"x" + b"\0\0"
    world.from_vehicle_side(unknown, peer="thief")
    position = common.MAVLink_local_position_ned_message(1, 9, 9, 0, 0, 0, 0)
    world.from_vehicle_side(packed(position, 1, 1), peer="thief")
    world.run(0.1)
    stop = world.client.stop()
    world.run(1)
    assert stop.result == common.MAV_RESULT_FAILED
    assert world.rover.autopilot.mode.name == "HOLD"  # it still hears us


def packed(message: object, system_id: int = 255, component_id: int = 190) -> bytes:
    raw: bytes = message.pack(common.MAVLink(None, system_id, component_id))  # type: ignore[attr-defined]
    return raw


def whole(message_id: int, crc_extra: int, payload: bytes, source: tuple[int, int]) -> bytes:
    """Return a MAVLink 2 packet with a good CRC and any payload."""
    head = bytes((len(payload), 0, 0, 0, *source)) + struct.pack("<I", message_id)[:3]
    crc = common.x25crc(head + payload)
    crc.accumulate(bytes((crc_extra,)))
    return b"\xfd" + head + payload + struct.pack("<H", crc.crc)


def test_what_is_no_ground_vehicle_is_not_driven(world: World) -> None:
    copter = common.MAVLink(None, 2, 1)
    world.from_vehicle_side(common.MAVLink_heartbeat_message(2, 3, 1, 0, 4, 3).pack(copter))
    world.run(0.5)
    assert [v.system_id for v in world.server.engine.snapshot(now=world.now).vehicles] == [1]
    noted = [event.text for event in world.events(VehicleNoted) if event.vehicle == 2]
    assert noted == ["has vehicle type 2, not that of a rover: not driven"]
