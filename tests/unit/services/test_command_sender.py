"""Commands under way to a vehicle, to exact times."""

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavResult
from mav_tasks.mavlink.messages import CommandAck, CommandLong, Message
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services.command_sender import (
    LATE,
    MAX_EACH,
    MAX_WAITING,
    REPEAT,
    Answered,
    CommandSender,
    Standing,
)

ARM = MavCmd.COMPONENT_ARM_DISARM
MODE = MavCmd.DO_SET_MODE
AUTOPILOT = 1
US = Address(250, 191)
CLIENT = Address(255, 190)
NOBODY = Address(0, 0)  # ArduPilot before 4.1 names nobody


def command(number: int = ARM, param1: float = 1.0) -> CommandLong:
    return CommandLong(1, AUTOPILOT, number, 0, param1, 0, 0, 0, 0, 0, 0)


def ack(number: int = ARM, result: int = MavResult.ACCEPTED, *, to: Address = NOBODY) -> CommandAck:
    return CommandAck(number, result, 0, 0, to.system_id, to.component_id)


def packet(number: int) -> Packet:
    return Packet(bytes([number]), number, CLIENT, CommandLong.id)


class Rig:
    """A sender in virtual time, and what came out of it."""

    def __init__(self) -> None:
        self.sender = CommandSender(US)
        self.sent: list[tuple[float, Message | Packet]] = []
        self.answers: list[tuple[float, Answered]] = []

    def take(self, now: float) -> None:
        outgoing, answers = self.sender.take()
        self.sent += [(round(now, 6), item) for item in outgoing]
        self.answers += [(round(now, 6), answer) for answer in answers]

    def run(self, until: float) -> None:
        """Do what is due, at exactly the times that the sender asks for."""
        while True:
            due = self.sender.next_deadline()
            if due is None or due > until:
                return
            self.sender.handle_deadline(now=due)
            self.take(due)
            assert self.sender.next_deadline() != due, "a deadline handled must be over"

    def request(self, message: CommandLong, now: float, *, immediate: bool = False) -> None:
        self.sender.request(message, now=now, give_up_after=1.0, immediate=immediate)
        self.take(now)

    def relay(
        self,
        number: int,
        origin: str,
        now: float,
        *,
        what: int = ARM,
        param1: float = 1.0,
        rank: float = 0,
        immediate: bool = False,
    ) -> None:
        self.sender.relay(
            packet(number),
            command(what, param1),
            origin,
            component=AUTOPILOT,
            command=what,
            standing=Standing(origin, rank),
            now=now,
            give_up_after=0.4,
            immediate=immediate,
        )
        self.take(now)

    def receive(self, message: CommandAck, now: float, *, component: int = AUTOPILOT) -> None:
        self.sender.receive(message, component=component, now=now)
        self.take(now)

    @property
    def times(self) -> list[float]:
        return [at for at, _ in self.sent]

    @property
    def results(self) -> list[tuple[float, object, int | None]]:
        """When, to whom, with which result each command was answered."""
        return [
            (at, answer.origin, None if answer.ack is None else answer.ack.result)
            for at, answer in self.answers
        ]


def test_our_own_command_is_repeated_until_it_is_given_up() -> None:
    rig = Rig()
    rig.request(command(), 5.0)
    rig.run(10.0)
    assert rig.times == [5.0, 5.0 + REPEAT, 5.0 + 2 * REPEAT, 5.0 + 3 * REPEAT]
    assert rig.results == [(6.0, None, None)]
    assert rig.sender.next_deadline() is None


def test_what_is_not_to_be_repeated_goes_again_when_it_is_told_to() -> None:
    rig = Rig()
    rig.sender.request(command(), now=5.0, give_up_after=3.0, repeats=False)
    rig.take(5.0)
    rig.run(6.0)
    assert not rig.sender.repeat(command(param1=0.0), now=6.0), "that was not asked for"
    assert rig.sender.repeat(command(), now=6.0)
    rig.take(6.0)
    rig.run(10.0)
    assert (rig.times, rig.results) == ([5.0, 6.0], [(9.0, None, None)])
    assert not rig.sender.repeat(command(), now=10.0), "it was given up"


def test_after_a_withdrawal_the_next_waits_for_the_answer_to_the_copy() -> None:
    rig = Rig()
    rig.sender.request(command(), now=5.0, give_up_after=3.0, repeats=False)
    rig.sender.repeat(command(), now=6.0)
    rig.sender.withdraw(AUTOPILOT, ARM)
    rig.take(6.0)
    rig.request(command(param1=0.0), 6.1)
    rig.run(6.5)
    assert rig.times == [6.0, 6.0, 6.0 + LATE]


def test_each_repeat_is_the_same_message_with_confirmation_0() -> None:
    rig = Rig()
    wanted = command()
    rig.request(wanted, 0.0)
    rig.run(0.5)
    assert [(item is wanted, wanted.confirmation) for _, item in rig.sent] == [(True, 0)] * 3


def test_an_answer_ends_the_repeats() -> None:
    rig = Rig()
    rig.request(command(), 0.0)
    rig.run(0.3)
    rig.receive(ack(result=MavResult.DENIED), 0.31)
    rig.run(5.0)
    assert rig.times == [0.0, 0.25]
    assert rig.results == [(0.31, None, MavResult.DENIED)]


def test_a_forwarded_command_is_sent_once_and_answered_to_who_asked() -> None:
    rig = Rig()
    rig.relay(1, "alice", 0.0)
    rig.receive(ack(result=MavResult.FAILED), 0.1)
    rig.run(5.0)
    assert rig.sent == [(0.0, packet(1))]
    assert rig.results == [(0.1, "alice", MavResult.FAILED)]


def test_a_forwarded_command_without_an_answer_is_given_up_after_its_time() -> None:
    rig = Rig()
    rig.relay(1, "alice", 0.0)
    rig.run(5.0)
    assert rig.results == [(0.4, "alice", None)]


def test_the_late_ack_of_a_command_given_up_answers_nobody() -> None:
    rig = Rig()
    rig.relay(1, "alice", 0.0)
    rig.run(0.4)
    rig.relay(2, "bob", 0.5)
    rig.receive(ack(), 0.55)  # alice's
    assert rig.results == [(0.4, "alice", None)]
    rig.run(0.4 + LATE)
    assert rig.sent == [(0.0, packet(1)), (0.8, packet(2))]
    rig.receive(ack(), 0.85)
    assert rig.results[1:] == [(0.85, "bob", MavResult.ACCEPTED)]


def test_a_second_command_of_an_id_waits_for_the_first_answer() -> None:
    rig = Rig()
    rig.relay(1, "alice", 0.0)
    rig.relay(2, "bob", 0.1)
    rig.receive(ack(result=MavResult.DENIED), 0.2)
    rig.receive(ack(result=MavResult.ACCEPTED), 0.3)
    assert rig.sent == [(0.0, packet(1)), (0.2, packet(2))]
    assert rig.results == [(0.2, "alice", MavResult.DENIED), (0.3, "bob", MavResult.ACCEPTED)]


def test_one_that_waits_is_given_up_within_its_own_time() -> None:
    rig = Rig()
    rig.request(command(), 0.0)
    rig.relay(2, "bob", 0.1)
    rig.run(0.5)
    assert rig.results == [(0.5, "bob", None)]
    assert packet(2) not in [item for _, item in rig.sent]


def test_commands_of_other_ids_and_components_do_not_wait() -> None:
    rig = Rig()
    rig.relay(1, "alice", 0.0)
    rig.relay(2, "bob", 0.0, what=MODE)
    rig.sender.relay(
        packet(3),
        command(),
        "carol",
        component=154,
        command=ARM,
        standing=Standing("carol", 0),
        now=0.0,
        give_up_after=0.4,
    )
    rig.take(0.0)
    assert rig.sent == [(0.0, packet(1)), (0.0, packet(2)), (0.0, packet(3))]
    rig.receive(ack(), 0.1, component=154)
    assert rig.results == [(0.1, "carol", MavResult.ACCEPTED)]


def test_an_urgent_command_does_not_wait_and_gets_its_own_answer() -> None:
    rig = Rig()
    rig.relay(1, "alice", 0.0)
    rig.relay(2, "bob", 0.1, immediate=True)
    assert rig.sent == [(0.0, packet(1)), (0.1, packet(2))]
    assert rig.results == [(0.1, "alice", None)]
    rig.receive(ack(result=MavResult.FAILED), 0.2)  # the vehicle's answer to alice
    assert rig.results[1:] == []
    rig.receive(ack(), 0.3)
    assert rig.results[1:] == [(0.3, "bob", MavResult.ACCEPTED)]


def test_two_clients_that_ask_for_the_same_urgent_thing_share_its_answer() -> None:
    rig = Rig()
    rig.relay(1, "alice", 0.0, immediate=True)
    rig.relay(2, "bob", 0.1, immediate=True)
    assert (rig.times, rig.results) == ([0.0, 0.1], [])
    rig.receive(ack(), 0.2)
    assert rig.results == [
        (0.2, "alice", MavResult.ACCEPTED),
        (0.2, "bob", MavResult.ACCEPTED),
    ]


def test_what_is_urgent_and_another_wish_has_an_answer_of_its_own() -> None:
    rig = Rig()
    rig.relay(1, "alice", 0.0, immediate=True)
    rig.relay(2, "bob", 0.1, param1=21196.0, immediate=True)
    rig.receive(ack(result=MavResult.FAILED), 0.2)
    rig.receive(ack(), 0.3)
    assert rig.results == [(0.1, "alice", None), (0.3, "bob", MavResult.ACCEPTED)]


def test_each_of_them_is_given_up_in_its_own_time() -> None:
    rig = Rig()
    rig.relay(1, "alice", 0.0, immediate=True)
    rig.relay(2, "bob", 0.1, immediate=True)
    rig.relay(3, "carol", 0.2, immediate=True)
    rig.run(0.45)
    assert rig.results == [(0.4, "alice", None)]
    rig.receive(ack(), 0.46)
    assert [origin for _, origin, _ in rig.results] == ["alice", "bob", "carol"]


def test_an_answer_owed_for_long_is_not_waited_for() -> None:
    rig = Rig()
    rig.request(command(MODE), 0.0)
    rig.request(command(MODE), 0.1, immediate=True)
    rig.receive(ack(MODE), 0.1 + LATE)
    assert rig.results == [(0.1, None, None), (0.1 + LATE, None, MavResult.ACCEPTED)]


def test_what_waits_is_bounded_and_the_rest_is_answered_at_once() -> None:
    rig = Rig()
    for number in range(MAX_WAITING + 3):
        rig.relay(number, f"client {number}", 0.0)
    assert rig.times == [0.0]
    assert rig.results == [(0.0, f"client {MAX_WAITING + n}", None) for n in (1, 2)]


def sent_numbers(rig: Rig) -> list[int]:
    return [item.raw[0] for _, item in rig.sent if isinstance(item, Packet)]


def test_one_client_has_no_more_than_its_share_of_what_waits() -> None:
    rig = Rig()
    for number in range(MAX_EACH + 3):
        rig.relay(number, "alice", 0.0)
    rig.relay(99, "bob", 0.0)
    assert rig.results == [(0.0, "alice", None)] * 3
    rig.receive(ack(), 0.1)
    assert sent_numbers(rig) == [0, 99], "whoever has nothing before it is next"


def test_what_was_not_sent_is_told_from_what_was_not_answered() -> None:
    rig = Rig()
    rig.relay(1, "alice", 0.0)
    rig.relay(2, "bob", 0.0)
    rig.run(1.0)
    assert {answer.origin: answer.was_sent for _, answer in rig.answers} == {
        "alice": True,
        "bob": False,
    }


def test_a_question_is_sent_only_while_the_vehicle_has_time_to_answer() -> None:
    rig = Rig()
    rig.relay(1, "alice", 0.0, what=MavCmd.REQUEST_MESSAGE)
    rig.relay(2, "bob", 0.0, what=MavCmd.REQUEST_MESSAGE, param1=2.0)
    rig.run(0.2)
    assert rig.results == [(0.2, "bob", None)]


def test_a_higher_rank_goes_first_and_displaces_the_last_of_a_full_lane() -> None:
    rig = Rig()
    for number in range(MAX_WAITING + 1):
        rig.relay(number, f"client {number}", 0.0)
    rig.relay(99, "operator", 0.0, rank=2)
    assert rig.results == [(0.0, f"client {MAX_WAITING}", None)]
    rig.receive(ack(), 0.1)
    assert sent_numbers(rig) == [0, 99]


def test_our_own_command_goes_before_those_of_clients() -> None:
    rig = Rig()
    rig.relay(1, "alice", 0.0)
    rig.relay(2, "bob", 0.0, rank=3)
    rig.request(command(), 0.0)
    rig.receive(ack(), 0.1)
    assert isinstance(rig.sent[-1][1], CommandLong)


def test_clients_that_ask_for_the_same_message_share_one_request() -> None:
    rig = Rig()
    for number, name in enumerate(("alice", "bob", "carol")):
        rig.relay(number, name, 0.01 * number, what=MavCmd.REQUEST_MESSAGE, param1=148.0)
    rig.relay(9, "dave", 0.03, what=MavCmd.REQUEST_MESSAGE, param1=147.0)
    rig.receive(ack(MavCmd.REQUEST_MESSAGE), 0.1)
    assert sorted(rig.results) == [
        (0.1, name, MavResult.ACCEPTED) for name in ("alice", "bob", "carol")
    ]
    assert sent_numbers(rig) == [0, 9]


def test_equal_commands_that_do_something_are_each_carried_out() -> None:
    rig = Rig()
    rig.relay(1, "alice", 0.0)
    rig.relay(2, "bob", 0.0)
    rig.receive(ack(), 0.1)
    assert sent_numbers(rig) == [1, 2]


def test_every_command_is_answered_exactly_once() -> None:
    rig = Rig()
    for number in range(2 * MAX_WAITING):
        rig.relay(number, number, 0.01 * number)  # type: ignore[arg-type]
    rig.run(60.0)
    assert sorted(origin for _, origin, _ in rig.results) == list(range(2 * MAX_WAITING))  # type: ignore[type-var]


def test_an_ack_that_nobody_waits_for_is_dropped() -> None:
    rig = Rig()
    rig.receive(ack(), 0.0)
    rig.request(command(MODE), 1.0)
    rig.receive(ack(ARM), 1.1)
    assert rig.results == []


def test_after_repeats_the_acks_of_the_other_copies_answer_nobody() -> None:
    rig = Rig()
    rig.request(command(), 0.0)
    rig.run(0.25)
    rig.receive(ack(), 0.3)
    rig.relay(1, "alice", 0.35)
    rig.receive(ack(), 0.36)  # of the second copy
    assert rig.results == [(0.3, None, MavResult.ACCEPTED)]
    rig.run(0.3 + LATE / 2)
    assert rig.sent[-1] == (0.5, packet(1))


def test_an_ack_meant_for_somebody_else_is_dropped() -> None:
    rig = Rig()
    rig.relay(1, "alice", 0.0)
    rig.receive(ack(result=MavResult.DENIED, to=US), 0.1)
    rig.receive(ack(result=MavResult.ACCEPTED, to=CLIENT), 0.2)
    assert rig.results == [(0.2, "alice", MavResult.ACCEPTED)]


def test_in_progress_is_no_answer_yet() -> None:
    rig = Rig()
    rig.relay(1, "alice", 0.0)
    rig.receive(ack(result=MavResult.IN_PROGRESS), 0.1)
    rig.receive(ack(result=MavResult.FAILED), 0.2)
    assert rig.results == [(0.2, "alice", MavResult.FAILED)]


def test_a_withdrawn_command_is_not_sent_again() -> None:
    rig = Rig()
    rig.request(command(), 0.0)
    rig.sender.withdraw(AUTOPILOT, ARM)
    rig.run(5.0)
    assert (rig.times, rig.results) == ([0.0], [])


def test_the_ack_of_a_withdrawn_command_answers_nobody() -> None:
    rig = Rig()
    rig.request(command(), 0.0)
    rig.sender.withdraw(AUTOPILOT, ARM)
    rig.relay(1, "alice", 0.1)
    rig.receive(ack(), 0.15)
    assert rig.results == []
    rig.run(LATE)
    assert rig.sent[-1] == (LATE, packet(1))


def test_withdrawing_ours_leaves_the_clients_in_the_queue() -> None:
    rig = Rig()
    rig.request(command(), 0.0)
    rig.relay(1, "alice", 0.1)
    rig.sender.withdraw(AUTOPILOT, ARM)
    rig.run(0.45)
    rig.receive(ack(), 0.46)
    assert rig.results == [(0.46, "alice", MavResult.ACCEPTED)]


def test_cancelling_answers_everybody_and_believes_no_ack_of_what_is_out() -> None:
    rig = Rig()
    rig.relay(1, "alice", 0.0)
    rig.relay(2, "bob", 0.1)
    rig.sender.cancel(AUTOPILOT, ARM, now=0.2)
    rig.take(0.2)
    rig.receive(ack(), 0.3)
    rig.run(5.0)
    assert rig.results == [(0.2, "bob", None), (0.2, "alice", None)]
    assert rig.sent == [(0.0, packet(1))]


def test_it_says_what_is_under_way() -> None:
    rig = Rig()
    rig.request(command(176), 0.0)
    assert repr(rig.sender) == "CommandSender(in_flight=[176])"
