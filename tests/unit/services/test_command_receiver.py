"""The same task twice? The five rules, but for the fourth, which this version does not need."""

from collections import OrderedDict
from math import nan

import pytest

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavResult
from mav_tasks.mavlink.messages import CommandAck, CommandInt, CommandLong
from mav_tasks.services.command_receiver import (
    CONFIRMED,
    NONCES,
    REMEMBERED,
    SAME_PACKET,
    SAME_PAYLOAD,
    Answer,
    Command,
    CommandReceiver,
    NonceReused,
    Pending,
    Repeat,
    command_of,
)

EPSILON = 1e-6


def move(
    distance: float = 2.0, *, confirmation: int = 0, number: int = MavCmd.TASK_MOVE
) -> Command:
    return command_of(CommandLong(1, 191, number, confirmation, distance, 0, 0, 0, 0, 0, nan))


def receiver() -> CommandReceiver:
    return CommandReceiver(OrderedDict())


def submit(to: CommandReceiver, command: Command, *, nonce: int = 0, now: float) -> Pending:
    """Submit something that is new."""
    assert to.same_submission(command, nonce=nonce, now=now) is None
    pending = to.remember(command, f"{command} {now}".encode(), now=now)
    to.remember_submission(pending, nonce=nonce)
    return pending


class TestReading:
    def test_a_command_long_has_no_frame(self) -> None:
        message = CommandLong(1, 191, 54000, 3, 1, 2, 3, 4, 5, 6, 7)
        assert command_of(message) == Command(
            Address(1, 191), 54000, (1, 2, 3, 4, 5, 6, 7), 3, None, message
        )

    def test_x_and_y_of_a_command_int_are_param5_and_param6(self) -> None:
        message = CommandInt(1, 191, 8, 54000, 0, 0, 1, 2, 3, 4, -5, 6, 7)
        assert command_of(message) == Command(
            Address(1, 191), 54000, (1, 2, 3, 4, -5.0, 6.0, 7), 0, 8, message
        )

    def test_an_answer_goes_to_who_asked(self) -> None:
        ack = Answer(54000, MavResult.ACCEPTED, 7, Address(1, 191)).ack(Address(255, 190))
        assert isinstance(ack, CommandAck)
        assert (ack.command, ack.result, ack.progress, ack.result_param2) == (54000, 0, 0, 7)
        assert (ack.target_system, ack.target_component) == (255, 190)


class TestTheVerySamePacket:
    def test_is_known_for_five_seconds(self) -> None:
        memory = receiver()
        pending = memory.remember(move(), b"packet", now=100.0)
        assert memory.same_packet(b"packet", now=100.0 + SAME_PACKET) is pending
        assert memory.same_packet(b"packet", now=100.0 + SAME_PACKET + EPSILON) is None

    def test_is_not_another_one(self) -> None:
        memory = receiver()
        memory.remember(move(), b"packet", now=0.0)
        assert memory.same_packet(b"Packet", now=0.0) is None

    def test_is_forgotten_after_many_others(self) -> None:
        memory = receiver()
        for number in range(REMEMBERED + 1):
            memory.remember(move(), number.to_bytes(2, "big"), now=0.0)
        assert memory.same_packet((0).to_bytes(2, "big"), now=0.0) is None
        assert memory.same_packet((1).to_bytes(2, "big"), now=0.0) is not None


class TestANonce:
    def test_makes_equal_commands_one(self) -> None:
        memory = receiver()
        first = submit(memory, move(), nonce=77, now=0.0)
        assert memory.same_submission(move(), nonce=77, now=1e6) == Repeat(first)

    def test_must_not_come_with_another_payload(self) -> None:
        memory = receiver()
        submit(memory, move(2.0), nonce=77, now=0.0)
        with pytest.raises(NonceReused):
            memory.same_submission(move(3.0), nonce=77, now=1.0)

    def test_makes_two_of_equal_payloads_if_it_differs(self) -> None:
        memory = receiver()
        submit(memory, move(), nonce=1, now=0.0)
        submit(memory, move(), nonce=2, now=0.0)

    def test_is_shared_by_all_endpoints_of_an_address(self) -> None:
        shared: OrderedDict[int, Pending] = OrderedDict()
        before, after = CommandReceiver(shared), CommandReceiver(shared)
        first = submit(before, move(), nonce=77, now=0.0)
        assert after.same_submission(move(), nonce=77, now=5.0) == Repeat(first)

    def test_of_a_refused_submission_may_be_used_again(self) -> None:
        memory = receiver()
        pending = submit(memory, move(2.0), nonce=77, now=0.0)
        memory.forget_submission(pending, nonce=77)
        submit(memory, move(3.0), nonce=77, now=1.0)

    def test_is_remembered_up_to_a_bound(self) -> None:
        nonces: OrderedDict[int, Pending] = OrderedDict()
        memory = CommandReceiver(nonces)
        pending = memory.remember(move(), b"", now=0.0)
        for nonce in range(1, NONCES + 3):
            memory.remember_submission(pending, nonce=nonce)
        assert (len(nonces), min(nonces)) == (NONCES, 3)


class TestConfirmation:
    def test_above_0_is_a_repeat_for_ten_seconds(self) -> None:
        memory = receiver()
        first = submit(memory, move(), now=0.0)
        again = move(confirmation=1)
        assert memory.same_submission(again, nonce=0, now=CONFIRMED) == Repeat(first)
        assert memory.same_submission(again, nonce=0, now=CONFIRMED + EPSILON) is None

    def test_with_other_parameters_is_no_repeat(self) -> None:
        memory = receiver()
        submit(memory, move(2.0), now=0.0)
        assert memory.same_submission(move(3.0, confirmation=1), nonce=0, now=0.1) is None


class TestAnEqualPayload:
    def test_is_the_same_task_for_a_while_after_each_copy(self) -> None:
        memory = receiver()
        first = submit(memory, move(), now=0.0)
        for now in (0.5, 1.0, 1.5, 1.5 + SAME_PAYLOAD):
            repeat = memory.same_submission(move(), nonce=0, now=now)
            assert repeat == Repeat(first, same_payload=True), now
        late = 1.5 + 2 * SAME_PAYLOAD + EPSILON
        assert memory.same_submission(move(), nonce=0, now=late) is None

    def test_with_one_of_the_same_command_in_between_is_three_tasks(self) -> None:
        memory = receiver()
        submit(memory, move(1.0), now=0.0)
        submit(memory, move(2.0), now=0.1)
        submit(memory, move(1.0), now=0.2)

    def test_with_another_command_in_between_is_still_the_same(self) -> None:
        memory = receiver()
        first = submit(memory, move(), now=0.0)
        submit(memory, move(90.0, number=MavCmd.TASK_ROTATE), now=0.1)
        assert memory.same_submission(move(), nonce=0, now=0.2) == Repeat(first, same_payload=True)

    def test_to_another_component_or_in_another_frame_is_another(self) -> None:
        memory = receiver()
        submit(memory, move(), now=0.0)
        elsewhere = command_of(CommandLong(1, 1, 54000, 0, 2.0, 0, 0, 0, 0, 0, nan))
        framed = command_of(CommandInt(1, 191, 8, 54000, 0, 0, 2.0, 0, 0, 0, 0, 0, nan))
        assert memory.same_submission(elsewhere, nonce=0, now=0.1) is None
        assert memory.same_submission(framed, nonce=0, now=0.1) is None

    def test_after_a_refusal_is_a_new_try(self) -> None:
        memory = receiver()
        pending = submit(memory, move(), now=0.0)
        memory.forget_submission(pending, nonce=0)
        submit(memory, move(), now=0.1)
