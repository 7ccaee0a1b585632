"""STOP for a vehicle of an earlier run that has not been heard yet."""

import pytest

from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import HaltsKept, LinkChanged, LinkSide, Packets
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Packer
from mav_tasks.mavlink.enums import MavResult
from mav_tasks.mavlink.packet import split_datagram
from mav_tasks.settings import Settings
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.task import Marks, Task, TaskId
from tests.unit.tasks.samples import FORWARD_2, SOMEBODY, TASK_MOVE

ROVER, CLIENT = ("10.0.0.1", 1), ("10.0.0.2", 2)


@pytest.mark.parametrize(("target", "source"), [((1, 191), (1, 191)), ((0, 0), (1, 191))])
def test_is_latched_answered_and_sent_first_when_it_is_heard(
    target: tuple[int, int], source: tuple[int, int]
) -> None:
    packer, decoder = Packer(), Decoder()
    task = Task(TaskId(1), 1, TASK_MOVE, FORWARD_2, SOMEBODY, Marks(), submitted_at=0.0)
    restored = Restored(tasks=(task,), next_id=2)
    engine = Engine(Settings(), now=0.0, restored=restored)
    engine.handle(LinkChanged("v", LinkSide.VEHICLES, up=True, is_local=True), now=0.0)
    engine.handle(LinkChanged("c", LinkSide.CLIENTS, up=True), now=0.0)

    stop = m.CommandLong(*target, 54003, 0, 0, 0, 0, 0, 0, 0, 0)
    data = packer.pack(stop, Address(255, 190), seq=0)
    engine.handle(Packets("c", [(CLIENT, data)]), now=1.0)
    engine.handle(HaltsKept(len(engine.take_events()) + 1), now=1.0)
    acks = [o.data for o in engine.take_packets() if o.peer == CLIENT and o.data[7] == 77]
    assert len(acks) == 1
    ack = decoder.decode(split_datagram(acks[0])[0])
    assert isinstance(ack, m.CommandAck)
    assert (ack.result, ack.result_param2) == (MavResult.FAILED, TaskReason.VEHICLE_SILENT)
    assert tuple(acks[0][5:7]) == source

    heartbeat = packer.pack(m.Heartbeat(10, 3, 1, 4, 4, 3), Address(1, 1), seq=0)
    engine.handle(Packets("v", [(ROVER, heartbeat)]), now=2.0)
    sent = [o.data for o in engine.take_packets() if o.peer == ROVER]
    kinds = [data[7] for data in sent if data[7] in (m.CommandLong.id, 84)]
    assert kinds[:2] == [m.CommandLong.id, 84], "HOLD, and zero with it"
    vehicle = engine.snapshot(now=2.0).vehicles[0]
    assert (vehicle.paused, vehicle.active) == (TaskReason.STOPPED, None)


def test_of_a_system_that_nobody_knows_is_for_somebody_else() -> None:
    engine, packer = Engine(Settings(), now=0.0), Packer()
    engine.handle(LinkChanged("c", LinkSide.CLIENTS, up=True), now=0.0)
    stop = m.CommandLong(9, 191, 54003, 0, 0, 0, 0, 0, 0, 0, 0)
    data = packer.pack(stop, Address(255, 190), seq=0)
    engine.handle(Packets("c", [(CLIENT, data)]), now=1.0)
    assert [o for o in engine.take_packets() if o.data[7] == 77] == []
