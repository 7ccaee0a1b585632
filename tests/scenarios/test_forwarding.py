"""Clients see the rover as if nothing stood between, and hear nothing that is not for them."""

from itertools import pairwise
from math import nan

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.shell.in_memory import VEHICLE_LINK
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import Faults
from tests.kit.cases import for_each
from tests.kit.client import (
    ACCEPTED,
    DENIED,
    FAILED,
    GUIDED,
    IDS,
    MOVE,
    REQUEST,
    RTL,
    SET_INTERVAL,
    SET_MODE,
    STOP,
    TASK_QUEUE_STATUS,
    TASK_STATUS,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    FakeClient,
    packed,
    setpoint,
)
from tests.kit.rows import check
from tests.kit.world import SETPOINT, World
from tests.scenarios.conftest import MakeWorld

ATTITUDE, POSITION = 30, 32
OUR_MESSAGES = range(54000, 54050)
CLEAR = 54011
FORMAT, IN_PROGRESS = 526, 5


def rate(client: FakeClient, message_id: int, since: float, until: float) -> float:
    return sum(since < p.at <= until for p in client.of_id(message_id)) / (until - since)


# telemetry


def test_the_first_of_a_system_is_its_autopilots_heartbeat_then_ours_once_a_second(
    world: World,
) -> None:
    late = world.add_client("late")
    world.run(0.3)
    world.client.move(3)
    world.run(8)
    for client in (world.client, late):
        first = next(p for p in client.received if p.source[0] == 1)
        assert (first.source, first.message_id) == ((1, 1), 0)
        beats = [p.at for p in client.of_id(0) if p.source == (1, 191)]
        assert len(beats) >= 8
        assert {round(b - a, 2) for a, b in pairwise(beats)} == {1.0}


def test_our_heartbeat_says_what_the_server_is_and_does(world: World) -> None:
    world.client.move(2)
    world.run(2)
    ours = [world.client.decoded(p) for p in world.client.of_id(0) if p.source == (1, 191)]
    assert {(h.type, h.autopilot, h.base_mode, h.custom_mode) for h in ours} == {(18, 8, 0, 0)}
    assert [ours[0].system_status, ours[-1].system_status] == [3, 4]


def test_each_client_has_its_own_intervals(world: World) -> None:
    fast, none, usual = world.client, world.add_client("none"), world.add_client("usual")
    world.run(0.1)
    sent = [
        fast.command(SET_INTERVAL, ATTITUDE, 40_000, target=(1, 1)),
        none.command(SET_INTERVAL, ATTITUDE, -1, target=(1, 1)),
        fast.command(SET_INTERVAL, POSITION, 1_000_000, target=(1, 191)),
    ]
    world.run(5)
    since = world.now
    world.run(10)
    rates = [rate(client, ATTITUDE, since, world.now) for client in (fast, none, usual)]
    assert rates == [pytest.approx(25, abs=1.5), 0, pytest.approx(10, abs=0.6)]
    assert rate(fast, POSITION, since, world.now) == pytest.approx(1, abs=0.2)
    assert [s.answer for s in sent] == [(ACCEPTED, 0)] * 3


def test_every_request_for_a_message_is_answered(world: World) -> None:
    check(
        world,
        """
REQUEST_MESSAGE 148 to=autopilot : ACCEPTED AUTOPILOT_VERSION
REQUEST_MESSAGE 435 to=autopilot : UNSUPPORTED
REQUEST_MESSAGE 435 : UNSUPPORTED
lose 77 & REQUEST_MESSAGE 148 to=autopilot & wait 0.6 : UNSUPPORTED
""",
    )


# commands


def test_acks_go_to_who_asked_though_both_are_called_the_same(world: World) -> None:
    twin = world.add_client("twin")
    world.run(0.1)
    world.client.move(1)
    twin.rotate(10)
    world.run(0.05)
    twin.command(REQUEST, 148, target=(1, 1))
    world.client.command(31000, target=(1, 1))
    world.run(0.2)
    assert [a.command for a in world.client.acks] == [54000, 31000]
    assert [a.command for a in twin.acks] == [54001, REQUEST]


def test_no_answer_in_0_4_s_is_a_rejection_and_the_late_ack_is_dropped(world: World) -> None:
    lost = world.lose_acks()
    at = world.now
    sent = world.client.command(31000, target=(1, 1))
    world.run(0.6)
    assert sent.answer == (TEMPORARILY_REJECTED, R.VEHICLE_SILENT)
    assert 0.4 <= sent.acked_at - at <= 0.5
    world.net.send("rover1", VEHICLE_LINK, lost[0])
    world.run(1)
    assert len(world.client.acks) == 1


def test_the_late_ack_of_one_client_is_not_given_to_another(world: World) -> None:
    twin = world.add_client("twin")
    world.run(0.1)
    lost = world.lose_acks()
    world.client.command(31000, target=(1, 1))
    world.run(0.41)
    world.watched.loses = lambda *_: False
    second = twin.command(31000, target=(1, 1))
    world.net.send("rover1", VEHICLE_LINK, lost[0])
    world.run(0.05)
    assert second.ack is None
    world.run(0.6)
    assert [len(c.acks) for c in (world.client, twin)] == [1, 1]


def test_disarm_never_waits(world: World) -> None:
    world.operator_arm(True)
    world.lose_acks()
    check(
        world,
        "ARM 1 & wait 0.01 : -\ntwin> ARM 0 & wait 0.05 : - it is DISARMED",
        twin=world.add_client("twin"),
    )


@for_each("result", [7, 8, 9, 200])
def test_a_result_that_crashes_clients_is_not_passed_on(world: World, result: int) -> None:
    world.lose_acks()
    sent = world.client.command(31000, target=(1, 1))
    world.run(0.05)
    world.watched.loses = lambda *_: False
    ack = common.MAVLink_command_ack_message(31000, result, 0, 0, 255, 190)
    world.from_vehicle_side(packed(ack, 1, 1), peer="rover1")
    world.run(0.1)
    assert sent.answer == (UNSUPPORTED, 0)


# task status


def test_a_status_is_shown_on_request(world: World) -> None:
    check(
        world,
        f"""
TASK_MOVE 2 : ACCEPTED
TASK_ROTATE 10 0 0 9 0 0 5 & wait 1.6 : ACCEPTED
SHOW 2 : ACCEPTED #0 / status 2: QUEUED BEHIND_OTHERS
SHOW 99 : DENIED #{R.NOT_FOUND} / no task 99
""",
    )
    status = world.client.statuses(2)[-1]
    shown = (status.nonce, status.command, status.priority, status.queue_position)
    assert shown == (9, 54001, 5, 1)


def test_a_status_is_pushed_to_who_submitted_and_to_nobody_else(world: World) -> None:
    other = world.add_client("other")
    world.run(0.1)
    other.request_status(1)
    world.client.move(0.3)
    world.until_idle(tasks=1)
    world.run(0.2)
    states = [s.state for s in world.client.statuses(1)]
    assert states[-3:] == [S.STARTING, S.EXECUTING, S.COMPLETED]
    assert other.statuses() == []
    final = world.client.statuses(1)[-1]
    assert (final.progress, final.target_system, final.target_component) == (100, 255, 190)
    assert final.execution_time > 0.5


@for_each(
    "command, params",
    [
        (192, (-1, 1, 0, nan, -35.36325, 149.16524)),
        (SET_MODE, (1, RTL)),
        (MOVE, (1.0,)),
        (STOP, (0.0,)),
        (CLEAR, (0.0,)),
    ],
)
def test_what_a_stock_client_may_send_brings_it_nothing_that_it_cannot_read(
    world: World, command: int, params: tuple[float, ...]
) -> None:
    """To its parser a message of our dialect is a packet lost."""
    stock = world.add_client("stock", reads_dialect=False)
    world.run(1.2)
    sent = stock.command(command, *params, target=(1, 1))
    world.run(3)
    assert sent.result == ACCEPTED
    assert not [p for p in stock.received if p.message_id in OUR_MESSAGES]


@for_each("how", ["nonce", "NaN", "asked", "streamed", "queue"])
def test_who_knows_our_dialect_is_told_of_its_tasks(world: World, how: str) -> None:
    client = world.add_client("stock", reads_dialect=False)
    world.run(1.2)
    nonce = {"nonce": 7.0, "NaN": nan}.get(how, 0.0)
    sent = client.command(MOVE, 0.5, 0, 0, nonce, 0, 0, 5)
    world.run(0.1)
    if how == "asked":
        client.request_status(sent.task_id)
    elif how == "streamed":
        client.command(SET_INTERVAL, TASK_STATUS, 100_000)
    elif how == "queue":
        client.command(REQUEST, TASK_QUEUE_STATUS)
    world.until_idle(tasks=1)
    world.run(0.1)
    assert client.statuses(1)[-1].state == S.COMPLETED


def test_a_rover_with_a_191_of_its_own_moves_the_server_to_192(world: World) -> None:
    companion = common.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)
    for seq in range(3):
        world.from_vehicle_side(packed(companion, 1, 191, seq=seq), peer="rover1")
        world.run(1)
    own = world.client.move(0.3, target=(1, 192))
    world.run(0.1)
    assert own.task_id == 1
    assert [p.source for p in world.client.of_id(TASK_STATUS)][:1] == [(1, 192)]
    assert world.client.said("192")
    world.client.stop(target=(1, 191))  # of habit
    world.run(3)
    assert world.paused() is R.STOPPED


# motion of clients


def test_a_clients_setpoints_do_not_reach_a_rover_that_is_not_armed(world: World) -> None:
    """It would keep the last one, and drive off when armed."""
    world.client.mode(GUIDED)
    world.run(0.5)
    world.client.stream(setpoint(0.5), rate=10)
    world.run(2)
    world.client.end_streams()
    assert SETPOINT not in [packet.kind for packet in world.observer.reached]
    world.operator_arm(True)
    world.run(2)
    assert world.stands()


@for_each("field", ["vx", "yaw_rate", "x"])
def test_a_setpoint_that_is_not_finite_never_reaches_the_rover(world: World, field: str) -> None:
    world.operator_arm(True)
    world.run(0.2)
    world.client.mode(GUIDED)
    world.run(0.5)
    bad = setpoint(0.5)
    setattr(bad, field, float("nan"))
    world.client.send(bad)
    world.run(0.1)
    assert 84 not in [packet.kind for packet in world.observer.reached]
    slow = world.client.command(178, 1, float("nan"), target=(1, 1))
    world.run(0.1)
    assert slow.answer == (DENIED, R.BAD_PARAMETER)


def test_a_client_on_mavlink_1_is_a_client(make_world: MakeWorld) -> None:
    world = make_world()
    old = world.add_client("old")
    old.heartbeats = False
    mav = common.MAVLink(None, 255, 190)
    old.send_raw(common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(mav, force_mavlink1=True))
    world.run(2)
    assert old.heard("ATTITUDE")
    assert all(p.raw[0] == 0xFD for p in old.received)


def test_ids_that_nobody_knows_pass_both_ways(world: World) -> None:
    unknown = bytes((0xFD, 3, 0, 0, 7, 1, 1, 0x11, 0x27, 0)) + b"abc" + b"\x12\x34"
    world.from_vehicle_side(unknown, peer="rover1")
    world.client.send_raw(unknown)
    world.run(0.1)
    assert [p.payload for p in world.client.of_id(0x2711)] == [b"abc"]


def test_keys_are_not_set_through_the_server(world: World) -> None:
    towards = world.passed_on((255, 190))
    check(world, "client:setup_signing 1 1 KEY 0 & client:ping 0 0 1 1 : -")
    assert (IDS["PING"] in towards, IDS["SETUP_SIGNING"] in towards) == (True, False)


def test_a_long_command_has_time_as_long_as_the_rover_says_it_goes_on(world: World) -> None:
    world.fault(Faults(withheld=frozenset({IDS["COMMAND_ACK"]})))

    def say(result: int, progress: int = 0) -> None:
        mav = common.MAVLink(None, 1, 1)
        ack = common.MAVLink_command_ack_message(FORMAT, result, progress, 0, 255, 190)
        world.from_vehicle_side(ack.pack(mav), peer="rover1")

    client = world.client
    for last in (ACCEPTED, FAILED):
        client.acks.clear()
        client.command(FORMAT, 1, 1, target=(1, 1))
        for progress in (10, 40, 90):
            world.run(0.3 if progress == 10 else 2.5)
            say(IN_PROGRESS, progress)
        world.run(2.5)
        say(last)
        world.run(0.1)
        assert [(a.result, a.progress) for a in client.acks] == [
            *((IN_PROGRESS, progress) for progress in (10, 40, 90)),
            (last, 0),
        ]
    client.command(FORMAT, 2, 1, target=(1, 1))
    world.run(0.3)
    say(IN_PROGRESS)
    world.run(3.5)
    assert client.acks_of(FORMAT)[-1] == (TEMPORARILY_REJECTED, R.VEHICLE_SILENT)
    assert world.observer.sent_since(0).count(str(FORMAT)) == 3
