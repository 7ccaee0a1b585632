"""Commands under way, to exact times."""

from mav_tasks.client.calls import AGAIN, LATE, Call, Calls
from mav_tasks.mavlink import messages as m

MOVE, CANCEL = 54000, 54010
ACCEPTED, DENIED, IN_PROGRESS = 0, 2, 5


class Rig:
    """Calls in virtual time, and what they sent and learned."""

    def __init__(self) -> None:
        self.calls = Calls()
        self.sent: list[tuple[float, int, float, int]] = []
        self.answers: list[tuple[str, int | None, float]] = []

    def begin(
        self,
        name: str,
        *,
        command: int = MOVE,
        vehicle: int = 1,
        within: float = 2.0,
        known: tuple[int, ...] = (),
        is_told_apart: bool = True,
        is_urgent: bool = False,
        now: float = 0.0,
    ) -> Call:
        def done(ack: m.CommandAck | None, *, now: float) -> None:
            self.answers.append((name, None if ack is None else ack.result_param2, now))

        message = m.CommandLong(vehicle, 1, command, 0, float(len(name)), 0, 0, 0, 0, 0, 0)
        call = Call(
            message,
            within,
            lambda ack: ack.result_param2 not in known,
            is_told_apart=is_told_apart,
            is_urgent=is_urgent,
        )
        call.done = done
        self.calls.begin(call, now=now)
        self.take(now)
        return call

    def ack(
        self, command: int, value: int, now: float, *, result: int = ACCEPTED, vehicle: int = 1
    ) -> None:
        self.run(now)
        message = m.CommandAck(command, result, 0, value, 244, 190)
        self.calls.receive(message, vehicle=vehicle, now=now)
        self.take(now)

    def take(self, now: float) -> None:
        for each in self.calls.take():
            assert isinstance(each, m.CommandLong)
            self.sent.append((round(now, 3), each.command, each.param1, each.confirmation))

    def run(self, until: float) -> None:
        while (due := self.calls.next_deadline()) is not None and due <= until:
            self.calls.handle_deadline(now=due)
            self.take(due)


def test_a_command_is_sent_again_until_it_is_answered_and_counts_its_copies() -> None:
    rig = Rig()
    rig.begin("a")
    rig.ack(MOVE, 7, 1.2)
    assert rig.sent == [(0.0, MOVE, 1, 0), (0.5, MOVE, 1, 1), (1.0, MOVE, 1, 2)]
    assert rig.answers == [("a", 7, 1.2)]
    rig.run(10.0)
    assert len(rig.sent) == 3


def test_silence_is_told_once_in_time() -> None:
    rig = Rig()
    rig.begin("a", within=1.0)
    rig.run(10.0)
    assert rig.answers == [("a", None, 1.0)]
    assert [at for at, *_ in rig.sent] == [0.0, 0.5]


def test_two_of_a_kind_go_one_after_the_other() -> None:
    rig = Rig()
    rig.begin("a")
    rig.begin("bb")
    assert [which for _, _, which, _ in rig.sent] == [1]
    rig.ack(MOVE, 7, 0.1)
    rig.ack(MOVE, 8, 0.2)
    assert rig.answers == [("a", 7, 0.1), ("bb", 8, 0.2)]


def test_commands_of_other_kinds_and_to_others_do_not_wait() -> None:
    rig = Rig()
    rig.begin("a")
    rig.begin("bb", command=CANCEL)
    rig.begin("ccc", vehicle=2)
    assert len(rig.sent) == 3
    rig.ack(MOVE, 9, 0.1, vehicle=2)
    rig.ack(CANCEL, 3, 0.1)
    assert [name for name, _, _ in rig.answers] == ["ccc", "bb"]


def test_a_late_copy_of_an_answer_is_not_the_next_ones() -> None:
    rig = Rig()
    rig.begin("a")
    rig.ack(MOVE, 7, 0.1)
    rig.begin("bb", known=(7,), now=0.1)
    rig.ack(MOVE, 7, 0.15)
    assert rig.answers == [("a", 7, 0.1)]
    rig.ack(MOVE, 8, 0.2)
    assert rig.answers[1:] == [("bb", 8, 0.2)]


def test_after_several_copies_the_lane_rests_so_that_a_late_refusal_hits_nobody() -> None:
    rig = Rig()
    rig.begin("a")
    rig.begin("bb")
    rig.ack(MOVE, 103, 0.7, result=DENIED)
    rig.ack(MOVE, 103, 0.8, result=DENIED)
    assert [name for name, _, _ in rig.answers] == ["a"]
    rig.run(0.7 + LATE)
    assert rig.sent[-1] == (round(0.7 + LATE, 3), MOVE, 2, 0)


def test_in_progress_is_no_answer_yet() -> None:
    rig = Rig()
    rig.begin("a")
    rig.ack(MOVE, 0, 0.1, result=IN_PROGRESS)
    assert rig.answers == []


def test_whoever_answers_what_was_sent_to_all_has_answered() -> None:
    rig = Rig()
    rig.begin("a", command=54003, vehicle=0)
    rig.ack(54003, 0, 0.1, vehicle=3)
    assert rig.answers == [("a", 0, 0.1)]


def test_what_is_settled_otherwise_makes_room_and_is_not_told() -> None:
    rig = Rig()
    first = rig.begin("a")
    waiting = rig.begin("bb")
    rig.begin("ccc")
    rig.calls.settle(waiting, is_answered=True, now=0.1)
    rig.calls.settle(first, is_answered=True, now=0.1)
    rig.take(0.1)
    assert [which for _, _, which, _ in rig.sent] == [1, 3]
    assert rig.answers == []
    assert rig.calls.next_deadline() == 0.1 + AGAIN


def test_after_an_answer_that_could_be_anybodys_the_lane_rests() -> None:
    rig = Rig()
    rig.begin("a", is_told_apart=False)
    rig.begin("bb", is_told_apart=False)
    rig.ack(MOVE, 0, 0.1)
    rig.ack(MOVE, 0, 0.2)
    assert rig.answers == [("a", 0, 0.1)]
    rig.ack(MOVE, 0, 0.1 + LATE)
    assert rig.answers[1:] == [("bb", 0, 0.1 + LATE)]


def test_after_a_refusal_it_rests_whatever_was_asked() -> None:
    rig = Rig()
    rig.begin("a")
    rig.begin("bb")
    rig.ack(MOVE, 103, 0.1, result=DENIED)
    rig.ack(MOVE, 103, 0.2, result=DENIED)
    assert rig.answers == [("a", 103, 0.1)]


def test_what_is_urgent_is_sent_at_once_and_again_when_it_has_its_turn() -> None:
    rig = Rig()
    rig.begin("a", is_told_apart=False)
    rig.ack(MOVE, 0, 0.1)
    rig.begin("bb", is_urgent=True, now=0.2)
    assert [(at, which) for at, _, which, _ in rig.sent] == [(0.0, 1), (0.2, 2)]
    rig.run(0.1 + LATE)
    assert [(at, which) for at, _, which, _ in rig.sent[2:]] == [(round(0.1 + LATE, 3), 2)]


def test_an_urgent_one_that_is_alone_is_sent_once() -> None:
    rig = Rig()
    rig.begin("a", is_urgent=True)
    assert len(rig.sent) == 1


def test_where_nobody_answers_those_that_wait_are_given_up_in_time_and_never_sent() -> None:
    rig = Rig()
    for name in ("a", "bb", "ccc"):
        rig.begin(name, within=2.0)
    rig.begin("dddd", within=2.0, now=1.0)
    rig.run(1.99)
    assert rig.answers == []
    rig.run(2.0)
    assert sorted(rig.answers) == [("a", None, 2.0), ("bb", None, 2.0), ("ccc", None, 2.0)]
    assert {which for _, _, which, _ in rig.sent} == {1}
    rig.run(10.0)
    assert rig.answers[3:] == [("dddd", None, 2.0 + LATE + 2.0)]


def test_what_nobody_waits_for_is_sent_no_more_and_its_late_answer_hits_nobody() -> None:
    rig = Rig()
    first = rig.begin("a")
    rig.begin("bb")
    rig.calls.settle(first, is_answered=False, now=0.1)
    rig.ack(MOVE, 7, 0.2)
    assert rig.answers == []
    rig.ack(MOVE, 8, 0.1 + LATE)
    assert rig.answers == [("bb", 8, 0.1 + LATE)]
    assert [which for _, _, which, _ in rig.sent] == [1, 2]
