"""Commands are read on one footing, and the very same packet is answered the same."""

from math import nan

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavResult
from mav_tasks.mavlink.messages import CommandAck, CommandInt, CommandLong
from mav_tasks.services.command_receiver import (
    REMEMBERED,
    SAME_PACKET,
    Answer,
    Command,
    CommandReceiver,
    command_of,
)

EPSILON = 1e-6


def move(
    distance: float = 2.0, *, confirmation: int = 0, number: int = MavCmd.TASK_MOVE
) -> Command:
    return command_of(CommandLong(1, 191, number, confirmation, distance, 0, 0, 0, 0, 0, nan))


def receiver() -> CommandReceiver:
    return CommandReceiver()


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
