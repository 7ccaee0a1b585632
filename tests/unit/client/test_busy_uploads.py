"""An upload gives way to another client's, and is not given up for it."""

from mav_tasks.client.transfers import BUSY_AGAIN, BUSY_WITHIN, Transfers
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavMissionResult
from mav_tasks.services.mission_item import Item

SERVER = Address(1, 191)
ITEM = Item(2, 54000, 0, 1, 1.0, 0.0, 0.0, 0.0, 0, 0, 0.0)
MISSION = 0

Outcome = tuple[MavMissionResult | None, int]


def begun(items: tuple[Item, ...] = (ITEM,)) -> tuple[Transfers, list[Outcome]]:
    transfers, outcomes = Transfers(SERVER), list[Outcome]()
    transfers.upload(MISSION, items, lambda *outcome: outcomes.append(outcome), now=0.0)
    assert names(transfers) == ["MissionCount"]
    return transfers, outcomes


def names(transfers: Transfers) -> list[str]:
    kinds = {m.MissionCount.id: "MissionCount", m.MissionItemInt.id: "MissionItemInt"}
    return [kinds[type(message).id] for message in transfers.take()]


def ack(result: MavMissionResult, opaque_id: int = 0) -> m.MissionAck:
    return m.MissionAck(244, 190, result, MISSION, opaque_id)


def test_a_server_that_takes_anothers_upload_is_asked_again() -> None:
    transfers, outcomes = begun()
    transfers.receive(ack(MavMissionResult.DENIED), now=0.1)
    assert (names(transfers), transfers.next_deadline()) == ([], 0.1 + BUSY_AGAIN)
    transfers.handle_deadline(now=0.1 + BUSY_AGAIN)
    assert names(transfers) == ["MissionCount"]
    transfers.receive(m.MissionRequestInt(244, 190, 0, MISSION), now=0.5)
    assert names(transfers) == ["MissionItemInt"]
    transfers.receive(ack(MavMissionResult.ACCEPTED, 7), now=0.6)
    assert outcomes == [(MavMissionResult.ACCEPTED, 7)]


def test_a_server_that_does_so_for_ever_has_refused() -> None:
    transfers, outcomes = begun()
    now = 0.0
    while not outcomes:
        transfers.receive(ack(MavMissionResult.DENIED), now=now)
        due = transfers.next_deadline()
        if due is not None:
            now = due
            transfers.handle_deadline(now=now)
    assert outcomes == [(MavMissionResult.DENIED, 0)]
    assert BUSY_WITHIN <= now < BUSY_WITHIN + 2 * BUSY_AGAIN


def test_a_plan_that_was_looked_at_and_refused_is_refused() -> None:
    transfers, outcomes = begun()
    transfers.receive(m.MissionRequestInt(244, 190, 0, MISSION), now=0.1)
    transfers.receive(ack(MavMissionResult.DENIED), now=0.2)
    assert outcomes == [(MavMissionResult.DENIED, 0)]
    transfers, outcomes = begun(())
    transfers.receive(ack(MavMissionResult.DENIED), now=0.1)
    assert outcomes == [(MavMissionResult.DENIED, 0)]
