"""Uploads by clients that know one kind of request only: DroneKit, older pymavlink scripts."""

import struct
from dataclasses import dataclass, field

import pytest
from pymavlink.dialects.v20 import common

from rover_sim.personas import ARDUPILOT, Persona
from tests.kit.cases import for_each
from tests.kit.client import FakeClient, Received
from tests.kit.mission import MISSION_ACK, REQUEST, REQUEST_INT, Ack, Download
from tests.kit.px4 import PROMPT_PX4
from tests.kit.world import World, at
from tests.scenarios.conftest import MakeWorld

WAYPOINT = 16


@dataclass
class DroneKit:
    """``cmds.upload()``: clears, says how many, answers MISSION_REQUEST with MISSION_ITEM.

    It never asks again, and takes no notice of MISSION_REQUEST_INT, or of how it ended.
    """

    client: FakeClient
    places: list[tuple[float, float]]
    system: int = 1
    knows: int = REQUEST
    sent: set[int] = field(default_factory=set)
    acks: list[Ack] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.client.roles.append(self)
        self.client.send(common.MAVLink_mission_clear_all_message(self.system, 0))
        self.client.send(common.MAVLink_mission_count_message(self.system, 0, len(self.places)))

    def next_deadline(self) -> float | None:
        return None

    def turn(self, *, now: float) -> None:
        pass

    def take(self, packet: Received, *, now: float) -> None:
        if packet.message_id == MISSION_ACK:
            self.acks.append(Ack.of(packet.payload))
        if packet.message_id != self.knows:
            return
        seq = struct.unpack("<H", packet.payload.ljust(2, b"\0")[:2])[0]
        place = at(*self.places[seq])
        x, y = place["x"] / 1e7, place["y"] / 1e7
        self.sent.add(seq)
        self.client.send(
            common.MAVLink_mission_item_message(
                self.system, 0, seq, 3, WAYPOINT, 0, 1, 0, 0, 0, 0, x, y, 0
            )
        )


PLACES = [(0.0, 0.0), (20.0, 0.0), (20.0, 20.0)]


@for_each("system", [0, 1])
@for_each(
    "persona, knows, within",
    [
        (ARDUPILOT, REQUEST, 0.2),
        (ARDUPILOT, REQUEST_INT, 0.5),
        (PROMPT_PX4, REQUEST_INT, 0.2),
        (PROMPT_PX4, REQUEST, 1.2),
    ],
)
def test_a_client_that_knows_one_kind_of_request_is_served(
    make_world: MakeWorld, persona: Persona, knows: int, within: float, system: int
) -> None:
    world = make_world(persona=persona)
    client = DroneKit(world.client, PLACES, knows=knows, system=system)
    world.until(lambda: len(client.sent) == len(PLACES), within=within + 0.3)  # after a clearing
    world.run(0.2)
    assert [ack.result for ack in client.acks] == [0, 0]
    assert stored(world) == len(PLACES)


def stored(world: World) -> int:
    download = Download(world.client)
    world.until(lambda: download.is_done, within=3)
    return len(download.items)


def test_a_download_is_answered_in_the_form_in_which_it_is_asked_for(world: World) -> None:
    client = DroneKit(world.client, PLACES)
    world.until(lambda: len(client.sent) == len(PLACES), within=2)
    world.run(0.2)
    world.client.send(common.MAVLink_mission_request_message(0, 0, 1))
    world.run(0.1)
    (item,) = world.client.of_type("MISSION_ITEM")
    assert (item.seq, item.command, item.frame) == (1, WAYPOINT, 3)
    wanted = at(*PLACES[1])
    assert item.x == pytest.approx(wanted["x"] / 1e7, abs=1e-5)
    assert item.y == pytest.approx(wanted["y"] / 1e7, abs=1e-5)
    world.client.send(common.MAVLink_mission_request_int_message(0, 0, 1))
    world.run(0.1)
    assert len(world.client.of_type("MISSION_ITEM_INT")) == 1
