"""Two gateways over one fleet: one has a rover, the other one takes over when that fails."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Settings
from mav_tasks.mavlink.signing import Key, signed, timestamp_at
from mav_tasks.shell.in_memory import VEHICLE_LINK
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.task import Task
from rover_sim.personas import PX4, Persona
from tests.kit.cases import for_each
from tests.kit.client import (
    ACCEPTED,
    GUIDED,
    PAUSE_CONTINUE,
    TEMPORARILY_REJECTED,
    FakeClient,
    command_long,
    packed,
    setpoint,
)
from tests.kit.gateways.engines import FleetWorld, Gateway
from tests.kit.px4 import PROMPT_PX4
from tests.kit.world import PROMPT

FENCE_LINK_ID, STEP = 254, 3.0  # of what a new gateway signs; s that it is ahead

#: s without a holder after a process has ended
AFTER_DEATH = 0.3
RELEASE, REMAINDER = 54013, 1


class Fleet(FleetWorld):
    """Two gateways and a client at each."""

    def __init__(self, folder: Path, *, settings: Settings | None = None, **kw: Any) -> None:
        super().__init__(folder, settings=settings or Settings(), **kw)
        self.clients = {"server": self.client}
        for number, name in enumerate(("b", "c")):
            it = self.add_client(
                f"client {name}", system_id=254 - 2 * number, server=f"{name}:clients"
            )
            self.clients[name] = it
        self.first = self.holder()
        self.run(4.0)

    @property
    def other(self) -> Gateway:
        """The gateway that does not have the rover at first."""
        other, *_ = (it for it in self.gateways.values() if it is not self.first)
        return other

    @property
    def near(self) -> FakeClient:
        """The client at the gateway that has the rover at first."""
        return self.clients[self.first.name]

    def task(self, task_id: int) -> Task:
        """Return a task as it is stored."""
        return {int(task.id): task for task in self.shared.tasks()}[task_id]

    def submit(self, metres: float) -> int:
        """Submit a move at the gateway that has the rover; return its id."""
        sent = self.near.move(metres)
        self.run(0.2)
        assert sent.result == ACCEPTED
        return sent.task_id

    def drives(self, task_id: int) -> None:
        """Let time pass until a task has driven for a while."""
        self.until(lambda: self.task(task_id).state is S.EXECUTING, within=10)
        self.run(1.0)


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[Fleet]:
    it = Fleet(tmp_path)
    yield it
    it.check()


def test_after_a_crash_the_other_one_holds_what_ran_and_what_waits_goes_on(fleet: Fleet) -> None:
    ran, waits = fleet.submit(5.0), fleet.submit(0.5)
    fleet.drives(ran)
    died_at = fleet.now
    fleet.kill(fleet.first.name)
    assert fleet.holder() is fleet.other
    assert fleet.other.got[-1][0] - died_at < AFTER_DEATH
    fleet.until(fleet.stands, within=5)
    assert (fleet.task(ran).state, fleet.task(ran).reason) == (S.HELD, R.OUTCOME_UNKNOWN)
    assert fleet.task(waits).state is S.QUEUED
    fleet.run(4.0)  # words from before do not count just after a takeover
    client = fleet.clients[fleet.other.name]
    sent = client.command(RELEASE, ran, REMAINDER)
    fleet.until(lambda: fleet.task(waits).state is S.COMPLETED, within=40)
    assert sent.result == ACCEPTED
    assert fleet.task(ran).state is S.COMPLETED
    assert abs(fleet.truth.north - 5.5) < 0.1
    assert fleet.other.engine.snapshot(now=fleet.now).tasks[-1].id == waits


def test_a_client_at_another_gateway_drives_the_rover_and_hears_of_it(fleet: Fleet) -> None:
    fleet.run(3.0)
    far = fleet.clients[fleet.other.name]
    sent = far.move(1.0, nonce=77)
    fleet.until(lambda: sent.ack is not None, within=2)
    assert sent.result == ACCEPTED
    fleet.until(lambda: fleet.task(sent.task_id).state is S.COMPLETED, within=20)
    began = fleet.now
    fleet.run(5.0)
    places = [p for p in far.of_id(32) if p.at >= began]
    assert 8 <= len(places) <= 12  # two a second, however often it comes to clients nearby
    assert S.COMPLETED in [status.state for status in far.statuses(sent.task_id)]
    again = far.move(1.0, nonce=77)
    fleet.run(0.5)
    assert again.task_id == sent.task_id  # also by way of the other gateway
    near = fleet.near.move(1.0, nonce=78)
    fleet.run(0.5)
    assert near.result == ACCEPTED


@pytest.mark.parametrize("everybody", [False, True])
def test_stop_at_any_gateway_stops_the_rover(fleet: Fleet, *, everybody: bool) -> None:
    task = fleet.submit(5.0)
    fleet.drives(task)
    far = fleet.clients[fleet.other.name]
    began = fleet.now
    sent = far.stop(target=(0 if everybody else 1, 191))
    fleet.until(lambda: fleet.task(task).state is S.KILLED, within=1)
    assert fleet.now - began < 0.1
    fleet.until(fleet.stands, within=3)
    fleet.run(0.5)
    assert sent.result == ACCEPTED
    epoch = fleet.shared.part(frozenset({1})).halt_epochs[1]
    fleet.kill(fleet.first.name)
    assert fleet.holder() is fleet.other
    fleet.run(1.0)
    after = fleet.shared.part(frozenset({1}))
    assert after.paused == {1: R.STOPPED}
    assert after.halt_epochs[1] >= epoch


@for_each("everybody", [False, True])
def test_a_stop_while_nobody_has_the_rover_is_in_force_as_soon_as_somebody_has(
    tmp_path: Path, *, everybody: bool
) -> None:
    fleet = Fleet(tmp_path, settings=Settings(on_takeover="resume"), names=("server", "b", "c"))
    task = fleet.submit(5.0)
    fleet.drives(task)
    others = [it.name for it in fleet.gateways.values() if it is not fleet.first]
    far = fleet.add_client("far", system_id=253, server=f"{others[0]}:clients")
    fleet.run(2.0)
    fleet.kill(fleet.first.name)
    sent = far.stop(target=(0 if everybody else 1, 191))
    fleet.run(0.05)
    assert fleet.database.holder(1) == fleet.first.name  # nobody has taken it yet
    assert fleet.holder().name in others
    fleet.run(1.0)
    assert fleet.shared.part(frozenset({1})).paused == {1: R.STOPPED}
    assert fleet.task(task).state is S.KILLED
    assert sent.result == ACCEPTED
    fleet.until(fleet.stands, within=5)


@pytest.mark.parametrize("other", [False, True])
def test_no_task_starts_on_a_taken_rover_before_the_gateway_has_listened(
    fleet: Fleet, *, other: bool
) -> None:
    """A second controller sends set-points to the rover, and its radio is heard here, too."""
    fleet.kill(fleet.first.name)
    taken = fleet.holder()
    took = taken.got[-1][0]
    link = VEHICLE_LINK.replace("server", taken.name)
    shown = fleet.now + 0.9

    def sends(now: float) -> None:
        nonlocal shown
        if other and now >= shown:
            shown += 0.9
            fleet.net.send("stranger", link, packed(setpoint(0.5), 9, 9))
        if "arm" in fleet.observer.sent_since(took):
            armed_at.append(now)

    armed_at: list[float] = []
    fleet.watch(sends)
    sent = fleet.clients[taken.name].move(2.0)
    fleet.run(0.3)
    assert sent.result == ACCEPTED
    if other:
        fleet.run(10.0)
        assert fleet.task(sent.task_id).state is S.QUEUED
        assert "arm" not in fleet.observer.sent_since(took)
    else:
        fleet.until(lambda: fleet.task(sent.task_id).state is S.COMPLETED, within=20)
        assert armed_at
        assert 1.0 <= armed_at[0] - took < 4.0


def texts(client: FakeClient) -> str:
    return "".join(client.texts())


def reach(fleet: Fleet, *gateways: Gateway, is_reached: bool) -> None:
    """Let these gateways, or all, reach the database, or not."""
    for it in gateways or fleet.gateways.values():
        it.is_reached = it.store.is_reached = is_reached


@pytest.mark.parametrize("after", [0.3, 2.0])
def test_a_stop_at_another_gateway_while_the_database_hangs_is_in_force_before_a_task_goes_on(
    fleet: Fleet, after: float
) -> None:
    task = fleet.submit(5.0)
    fleet.drives(task)
    reach(fleet, is_reached=False)
    fleet.run(after)
    far = fleet.clients[fleet.other.name]
    sent = far.stop()
    fleet.run(0.1)
    assert ("STOP waits for the fleet's database" in texts(far)) is (after > 1.0)
    fleet.run(10.0)
    assert sent.ack is None
    assert fleet.stands()
    where = fleet.truth.north
    reach(fleet, is_reached=True)
    fleet.run(10.0)
    assert sent.result == ACCEPTED
    assert fleet.task(task).state is S.KILLED
    assert fleet.shared.part(frozenset({1})).paused == {1: R.STOPPED}
    assert abs(fleet.truth.north - where) < 0.05


@for_each("is_answered", [False, True])
def test_a_stop_that_no_gateway_could_obey_is_in_force_when_its_gateway_is_back(
    tmp_path: Path, *, is_answered: bool
) -> None:
    """Nobody else hears the rover: the same gateway gets it again, in another life."""
    fleet = Fleet(tmp_path, settings=Settings(on_takeover="resume"))
    fleet.cut(fleet.other.name)
    fleet.run(6.0)
    task = fleet.submit(5.0)
    fleet.drives(task)
    far = fleet.clients[fleet.other.name]
    if is_answered:  # and resumed since: it is not owed any more
        sent = far.stop()
        fleet.run(1.0)
        assert sent.result == ACCEPTED
        fleet.near.proceed()
        fleet.run(5.0)
        task = fleet.submit(5.0)
        fleet.drives(task)
    reach(fleet, fleet.first, is_reached=False)
    fleet.run(2.0)
    if not is_answered:
        far.stop()
    fleet.run(8.0)
    assert fleet.database.holder(1) is None
    reach(fleet, fleet.first, is_reached=True)
    assert fleet.holder() is fleet.first
    fleet.run(10.0)
    assert (fleet.task(task).state is S.KILLED) is not is_answered
    stopped = {} if is_answered else {1: R.STOPPED}
    assert fleet.shared.part(frozenset({1})).paused == stopped


def test_a_resume_that_waited_at_another_gateway_undoes_no_newer_pause(fleet: Fleet) -> None:
    task = fleet.submit(5.0)
    fleet.drives(task)
    fleet.near.pause()
    fleet.run(4.0)
    far, before = fleet.clients[fleet.other.name], fleet.truth.north
    fleet.freeze(fleet.other.name)
    far.send(command_long(PAUSE_CONTINUE, 1))
    fleet.run(0.1)
    fleet.near.pause()
    fleet.run(0.1)
    fleet.other.is_frozen = False
    fleet.run(3.0)
    assert far.acks_of(PAUSE_CONTINUE) == [(TEMPORARILY_REJECTED, R.STALE)]
    assert abs(fleet.truth.north - before) < 0.01
    fleet.run(1.5)
    far.proceed()
    fleet.until(lambda: fleet.task(task).state is S.COMPLETED, within=20)


@for_each("persona", [PROMPT, PX4, PROMPT_PX4])
@for_each("away", [2.5, 6.0])
def test_a_loss_of_the_database_stops_the_rover_and_the_task_goes_on(
    tmp_path: Path, away: float, persona: Persona
) -> None:
    fleet = Fleet(tmp_path, persona=persona)
    task = fleet.submit(5.0)
    fleet.drives(task)
    reach(fleet, is_reached=False)
    fleet.run(away)
    assert fleet.stands()
    reach(fleet, is_reached=True)
    fleet.until(lambda: fleet.task(task).state is S.COMPLETED, within=40)
    assert abs(fleet.truth.north - 5.0) < 0.2
    if fleet.first.name == "server":
        assert {why for _, why in fleet.history(task)} & {R.LEASE_LOST, R.FAILSAFE}
    fleet.check()


def test_a_client_that_drives_is_stopped_when_the_lease_ends(fleet: Fleet) -> None:
    client = fleet.near
    client.mode(GUIDED)
    fleet.run(0.5)
    client.arm()
    fleet.run(1.0)
    client.stream(setpoint(0.5), rate=10)
    fleet.run(3.0)
    assert not fleet.stands()
    reach(fleet, fleet.first, is_reached=False)
    fleet.run(1.0)
    fleet.until(fleet.stands, within=3)
    north = fleet.truth.north
    fleet.run(3.0)  # its stream goes on
    assert abs(fleet.truth.north - north) < 0.05


@for_each("moved", [False, True])
def test_a_task_resumes_after_a_takeover_if_the_settings_say_so(
    tmp_path: Path, *, moved: bool
) -> None:
    fleet = Fleet(tmp_path, settings=Settings(on_takeover="resume"))
    task = fleet.submit(5.0)
    fleet.drives(task)
    fleet.kill(fleet.first.name)
    assert fleet.holder() is fleet.other
    if moved:
        fleet.until(fleet.stands, within=5)
        fleet.rover.push(0.0, 2.0, 0.0)  # somebody carries it aside
        fleet.until(lambda: fleet.task(task).state is S.HELD, within=10)
        assert fleet.task(task).reason is R.OFF_TRACK
    else:
        fleet.until(lambda: fleet.task(task).state is S.COMPLETED, within=40)
        assert abs(fleet.truth.north - 5.0) < 0.1
    fleet.check()


def test_a_rover_that_was_disarmed_between_two_gateways_waits_for_a_person(tmp_path: Path) -> None:
    """Perhaps a person did it, or the gateway before at the end of the task, which it lost."""
    fleet = Fleet(tmp_path, settings=Settings(on_takeover="resume"))
    task = fleet.submit(5.0)
    fleet.drives(task)
    fleet.until(lambda: fleet.now % 1.0 > 0.9, within=1.1)  # shown before it is met
    fleet.kill(fleet.first.name)
    fleet.operator_arm(False)
    assert fleet.holder() is fleet.other
    fleet.until(lambda: fleet.task(task).state is S.HELD, within=45)
    assert fleet.task(task).reason is R.OUTCOME_UNKNOWN
    assert not fleet.is_armed
    fleet.check()


KEY, UTC = Key("rovers", bytes(range(32))), 1.8e9


def test_a_signed_rover_itself_refuses_a_stale_gateway(tmp_path: Path) -> None:
    """Also one whose clock is right and that signs now, without any guard of its own."""
    fleet = Fleet(tmp_path, keys=(KEY,), rover_key=KEY, wall_offset=UTC)
    task = fleet.submit(8.0)
    fleet.drives(task)
    fleet.freeze(fleet.first.name)
    assert fleet.holder() is fleet.other
    fleet.until(fleet.stands, within=8)
    assert fleet.task(task).state is S.HELD
    judge = Judge()
    north = fleet.truth.north

    def look(source: str, target: str, data: bytes) -> bool:
        if (source, target) == (f"{fleet.other.name}:vehicles", "rover1"):
            judge.accepted += judge.accepts(data)
        return False

    fleet.watched.loses = look
    fleet.run(1.2)  # a heartbeat comes each second
    assert judge.accepted > 1
    fleet.watched.to_vehicles.clear()  # the observers need not see what is refused
    for _ in range(40):
        stale = by_stale(fleet.now)
        assert not judge.accepts(stale)
        fleet.net.send(f"{fleet.first.name}:vehicles", "rover1", stale)
        fleet.run(0.05)
    assert abs(fleet.truth.north - north) < 0.02
    # so that this means something: one with a lead as that of the holder is accepted
    assert judge.accepts(by_stale(fleet.now, lead=3 * STEP))


def by_stale(now: float, *, lead: float = STEP) -> bytes:
    """Return a setpoint that a gateway with the lead of the first takeover signs now."""
    packer = common.MAVLink(None, srcSystem=250, srcComponent=191)
    raw = bytes(setpoint(1.0).pack(packer))
    at = timestamp_at(UTC + now + lead)
    return signed(raw, KEY.secret, link_id=FENCE_LINK_ID, timestamp=at)


class Judge:
    """pymavlink's own verifier of signatures, as a rover that takes signed packets only."""

    def __init__(self) -> None:
        self._mav = common.MAVLink(None)
        self._mav.robust_parsing = True
        self._mav.signing.secret_key = KEY.secret
        self._mav.signing.timestamp = timestamp_at(UTC)
        self.accepted = 0

    def accepts(self, data: bytes) -> bool:
        """Return whether a packet is verified and newer than the one before."""
        found = self._mav.parse_buffer(data) or []
        return all(message.get_type() != "BAD_DATA" for message in found) and bool(found)
