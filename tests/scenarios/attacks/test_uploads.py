"""S4: whoever uploads slowly keeps nobody with more rights waiting, and nobody for long."""

from dataclasses import dataclass, field

from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Roles, Settings
from tests.kit.cases import anew, for_each
from tests.kit.client import FakeClient, Received
from tests.kit.mission import MISSION_ACK, REQUEST, REQUEST_INT, Ack, Item, Upload
from tests.kit.world import World, at
from tests.scenarios.conftest import MakeWorld
from tests.scenarios.test_roles import join

MISSION, FENCE = 0, 1
WAYPOINT, FENCE_CIRCLE = 16, 5003
MISSION_ACCEPTED, MISSION_DENIED, CANCELLED = 0, 14, 15
SILENCE = 2.2  # s, just less than the server waits for an item
ROLES = {
    "10/190": "submitter",
    "11/190": "submitter",
    "12/190": "operator",
    "13/190": "safety",
    "14/190": "safety",
}
PLAN = [Item(WAYPOINT, **at(north, 0.0)) for north in (1.0, 2.0)]
CIRCLE = [Item(FENCE_CIRCLE, **at(0.0, 0.0), param1=50.0)]


@dataclass
class SlowUpload:
    """Sends an item each 2.2 s, for ever: neither silent nor ready."""

    client: FakeClient
    kind: int = MISSION
    count: int = 5000
    target: tuple[int, int] = (1, 1)
    asked: int = -1
    acks: list[tuple[float, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._next_at = self.client.net.now + SILENCE
        self.client.roles.append(self)
        self.client.send(common.MAVLink_mission_count_message(*self.target, self.count, self.kind))

    def next_deadline(self) -> float | None:
        return None if self.acks else self._next_at

    def turn(self, *, now: float) -> None:
        if not self.acks and now >= self._next_at:
            self._next_at = now + SILENCE
            if self.asked >= 0:
                item = PLAN[self.asked % 2] if self.kind == MISSION else CIRCLE[0]
                self.client.send(item.message(self.asked, self.kind, self.target))

    def take(self, packet: Received, *, now: float) -> None:
        if packet.message_id in (REQUEST, REQUEST_INT):
            self.asked = max(
                self.asked, int.from_bytes(packet.payload[:2].ljust(2, b"\0"), "little")
            )
        elif packet.message_id == MISSION_ACK:
            self.acks.append((now, Ack.of(packet.payload).result))


@anew
def world(make_world: MakeWorld) -> World:
    return make_world(settings=Settings(roles=Roles(unsigned="safety", addresses=ROLES)))


def result(world: World, upload: Upload) -> int | None:
    world.until(lambda: upload.result is not None, within=5)
    return upload.result


@for_each("target", [(1, 1), (1, 191)])
def test_a_slow_submitter_keeps_no_operator_s_mission_out(
    world: World, target: tuple[int, int]
) -> None:
    submitter, operator = join(world, 10), join(world, 12)
    slow = SlowUpload(submitter, target=target)
    world.run(10.0)
    assert not slow.acks
    assert result(world, Upload(operator, PLAN, target=target)) == MISSION_ACCEPTED
    (displaced,) = slow.acks
    assert displaced[1] == MISSION_DENIED
    assert submitter.said("a client with a higher role is uploading")
    assert [task.submitter.system_id for task in world.tasks()] == [12]


def test_a_slow_mission_keeps_no_fence_out(world: World) -> None:
    """Not even of the same role: a fence is another upload."""
    slow = SlowUpload(join(world, 13))
    fence = Upload(join(world, 14), CIRCLE, kind=FENCE)
    assert result(world, fence) == MISSION_ACCEPTED
    world.run(5.0)
    assert not slow.acks, "and goes on"


def test_an_upload_that_is_slow_for_ever_ends(world: World) -> None:
    """After a minute and half a second for each item: 35 of them at this pace."""
    began = world.now
    slow = SlowUpload(join(world, 10))
    waiting = join(world, 11)
    world.until(lambda: slow.acks, within=90)
    ended, how = slow.acks[0]
    assert (how, 70 < ended - began < 85) == (CANCELLED, True)
    assert slow.client.said("took more than 60 s")
    assert result(world, Upload(waiting, PLAN)) == MISSION_ACCEPTED
    assert [task.submitter.system_id for task in world.tasks()] == [11]
