"""Uploads of plans, to exact times, with a client made by hand."""

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import target_of
from mav_tasks.mavlink.enums import MavMissionResult as Result
from mav_tasks.services.mission_item import Item
from mav_tasks.services.mission_receiver import (
    ASK_AGAIN,
    CAPACITY,
    EACH_ITEM,
    GIVE_UP,
    LONGEST,
    QUIET,
    MissionReceiver,
    RequestForm,
    Sender,
    Upload,
)

ROVER = Address(1, 1)
ALICE = Sender("alice", Address(255, 190), ROVER)
BOB = Sender("bob", Address(255, 190), ROVER)
MISSION, FENCE = 0, 1


def item(seq: int, *, north: int = 0, kind: int = MISSION) -> m.MissionItemInt:
    return m.MissionItemInt(
        1, 1, seq, 3, 16, 0, 1, 0, 0, 0, 0, 470000000 + north, 80000000, 0, kind
    )


class Rig:
    """A receiver in virtual time."""

    def __init__(
        self, *, refused: int | None = None, form: RequestForm = m.MissionRequestInt
    ) -> None:
        self.now = 0.0
        self.refused = refused  # the command that is
        self.receiver = MissionReceiver(check=self.check, form=form)
        self.uploads: list[Upload] = []
        self.forms: list[type[m.Message]] = []  # of the requests

    def check(self, kind: int, seq: int, item: Item, count: int) -> Result | None:
        assert (kind in (MISSION, FENCE), seq < count) == (True, True)
        return Result.UNSUPPORTED if item.command == self.refused else None

    def said(self) -> list[tuple[str, str, int]]:
        """Return whom what was told: requests with their number, acks with their result."""
        outgoing, uploads = self.receiver.take()
        self.uploads += uploads
        words = []
        for sender, message, _why in outgoing:
            assert target_of(message) == sender.address
            match message:
                case m.MissionRequest() | m.MissionRequestInt():
                    self.forms.append(type(message))
                    words.append((str(sender.key), "request", message.seq))
                case m.MissionAck():
                    words.append((str(sender.key), "ack", message.type))
        return words

    def count(
        self, number: int, sender: Sender = ALICE, *, kind: int = MISSION, rank: int = 1
    ) -> "Rig":
        message = m.MissionCount(1, 1, number, kind)
        self.receiver.count(message, sender, rank=rank, now=self.now)
        return self

    def item(self, seq: int, sender: Sender = ALICE, **what: int) -> None:
        self.receiver.item(item(seq, **what), sender, now=self.now)

    def cancel(self, sender: Sender = ALICE) -> None:
        message = m.MissionAck(1, 1, Result.OPERATION_CANCELLED, MISSION)
        self.receiver.cancelled(message, sender, now=self.now)

    def run(self, until: float) -> list[tuple[float, str, int]]:
        """Do what is due at exactly the times that are asked for."""
        seen = []
        while (due := self.receiver.next_deadline()) is not None and due <= until:
            self.now = due
            self.receiver.handle_deadline(now=due)
            seen += [(round(due, 6), what, number) for _, what, number in self.said()]
        self.now = until
        return seen

    def uploaded(self, count: int = 2, sender: Sender = ALICE) -> "Rig":
        self.count(count, sender)
        for seq in range(count):
            self.item(seq, sender)
        self.said()
        return self


def test_each_item_is_asked_for_and_the_whole_is_acknowledged_when_it_is_decided() -> None:
    rig = Rig()
    rig.count(2)
    assert rig.said() == [("alice", "request", 0)]
    rig.item(0)
    assert rig.said() == [("alice", "request", 1)]
    rig.item(1, north=5)
    assert (rig.said(), len(rig.uploads)) == ([], 1)
    (upload,) = rig.uploads
    assert [i.x for i in upload.items] == [470000000, 470000005]
    rig.receiver.finish(Result.ACCEPTED, opaque_id=17, now=0.1)
    outgoing, _ = rig.receiver.take()
    (ack,) = [told.message for told in outgoing]
    assert isinstance(ack, m.MissionAck)
    assert (ack.type, ack.opaque_id, ack.mission_type) == (Result.ACCEPTED, 17, MISSION)


def test_an_empty_plan_is_whole_at_once() -> None:
    rig = Rig().count(0)
    assert (rig.said(), rig.uploads) == ([], [Upload(ALICE, MISSION, (), begun_at=0.0)])


def test_what_does_not_come_is_asked_for_again_until_it_is_given_up() -> None:
    rig = Rig().count(2)
    rig.item(0)
    rig.said()
    seen = rig.run(5.0)
    asked = [1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1]
    assert seen == [
        *[(round(ASK_AGAIN * n, 6), "request", seq) for n, seq in enumerate(asked, start=1)],
        (GIVE_UP, "ack", Result.OPERATION_CANCELLED),
    ]
    assert rig.receiver.next_deadline() is None


def test_a_client_that_a_late_request_has_taken_back_is_led_on_again() -> None:
    rig = Rig().count(6)
    for seq in range(5):
        rig.item(seq)
    rig.said()
    seen = [seq for _, _, seq in rig.run(0.85)]
    assert seen == [5, 4, 5, 3]
    answered = []
    for seq in (3, 4, 5):  # it goes on where it was taken back to
        rig.item(seq)
        answered += rig.said()
    assert answered == [("alice", "request", 4), ("alice", "request", 5)]
    assert [len(upload.items) for upload in rig.uploads] == [6]


def test_an_item_that_comes_twice_or_too_early_changes_nothing() -> None:
    rig = Rig().count(3)
    rig.item(0)
    for seq in (0, 2, 0):
        rig.item(seq)
    assert rig.said() == [("alice", "request", 0), ("alice", "request", 1)]
    rig.item(1)
    rig.item(2)
    rig.said()
    assert len(rig.uploads[0].items) == 3


def test_a_bad_item_is_refused_as_it_comes() -> None:
    rig = Rig(refused=16).count(3)
    rig.said()
    rig.item(0)
    assert rig.said() == [("alice", "ack", Result.UNSUPPORTED)]
    assert rig.receiver.next_deadline() is None


def test_another_client_is_denied_and_disturbs_nothing() -> None:
    rig = Rig().count(2)
    rig.said()
    rig.count(5, BOB)
    assert rig.said() == [("bob", "ack", Result.DENIED)]
    rig.item(0, BOB)
    rig.item(0)
    rig.item(1)
    assert ("bob", "ack", Result.DENIED) not in rig.said()
    assert rig.uploads[0].sender == ALICE


def test_another_client_is_denied_also_while_it_is_being_decided() -> None:
    rig = Rig().uploaded()
    rig.count(1, BOB)
    assert rig.said() == [("bob", "ack", Result.DENIED)]
    rig.count(1)
    assert rig.said() == []
    rig.receiver.finish(Result.ACCEPTED, opaque_id=1, now=0.0)
    assert rig.said() == [("alice", "ack", Result.ACCEPTED)]


def test_one_of_a_higher_rank_uploads_instead_and_the_other_is_told() -> None:
    rig = Rig().count(2)
    rig.item(0)
    rig.said()
    rig.count(1, BOB, rank=2)
    assert rig.said() == [("alice", "ack", Result.DENIED), ("bob", "request", 0)]
    rig.item(1)  # which alice had been asked for
    rig.count(2)
    assert rig.said() == [("alice", "ack", Result.DENIED)]
    rig.item(0, BOB)
    rig.said()
    assert [(upload.sender, len(upload.items)) for upload in rig.uploads] == [(BOB, 1)]


def test_what_is_being_decided_about_is_displaced_by_nobody() -> None:
    rig = Rig().uploaded()
    rig.count(1, BOB, rank=2)
    assert rig.said() == [("bob", "ack", Result.DENIED)]


def test_an_upload_has_a_minute_and_half_a_second_for_each_item() -> None:
    """However often it is begun again meanwhile; its count is worth nothing."""
    rig = Rig().count(CAPACITY)
    seen: list[tuple[float, str, int]] = []
    items = 0
    while not any(what == "ack" for _, what, _ in seen):
        seen += rig.run(rig.now + 2.0)
        if items % 7 == 6:
            rig.count(CAPACITY)
        rig.item(items % 7)
        items += 1
    ended, _, result = seen[-1]
    assert result == Result.OPERATION_CANCELLED
    assert LONGEST < ended <= LONGEST + EACH_ITEM * items


@pytest.mark.parametrize("pace", [0.1, 0.3])  # s for an item, over a radio of 57,600 baud
def test_the_longest_plan_over_a_slow_radio_has_time_enough(pace: float) -> None:
    rig = Rig().count(CAPACITY)
    for seq in range(CAPACITY):
        rig.run(rig.now + pace)
        rig.item(seq)
    rig.said()
    assert [len(upload.items) for upload in rig.uploads] == [CAPACITY]


def test_the_same_count_again_may_be_of_another_plan() -> None:
    rig = Rig().count(2)
    rig.run(0.5)
    rig.count(2)
    rig.item(0, north=1)  # on its way since before the count
    assert rig.run(0.5 + QUIET) == [(0.5 + QUIET, "request", 0)]
    rig.item(0, north=2)
    rig.item(1, north=3)
    rig.said()
    assert [i.x - 470000000 for i in rig.uploads[0].items] == [2, 3]


def test_an_upload_right_after_another_takes_no_item_of_it() -> None:
    rig = Rig().uploaded(2)
    rig.receiver.finish(Result.ACCEPTED, opaque_id=7, now=0.0)
    rig.said()
    rig.now = 0.1
    rig.count(2)
    rig.item(0)  # one that was doubled on the way
    assert rig.run(0.1 + QUIET) == [(0.1 + QUIET, "request", 0)]


def test_an_upload_begun_again_takes_no_item_of_the_one_before() -> None:
    rig = Rig().count(2)
    rig.item(0, north=1)
    rig.said()
    rig.count(2)
    assert rig.said() == []  # until what was on its way has arrived
    rig.item(0, north=1)
    assert rig.run(QUIET) == [(QUIET, "request", 0)]
    rig.item(0, north=2)
    rig.item(1, north=3)
    rig.said()
    assert [i.x - 470000000 for i in rig.uploads[0].items] == [2, 3]


@pytest.mark.parametrize(("pause", "is_same"), [(1.0, True), (9.9, True), (10.1, False)])
@pytest.mark.parametrize("how", ["silent", "given up", "refused"])
def test_a_try_soon_after_one_in_vain_counts_from_the_first(
    how: str, pause: float, is_same: bool
) -> None:
    """By that it is known whether the plan is one that came before and was not heard of."""
    rig = Rig(refused=16 if how == "refused" else None).count(2)
    if how == "silent":
        rig.run(GIVE_UP)
    elif how == "given up":
        rig.cancel()
    else:
        rig.item(0)
    rig.refused = None
    rig.run(rig.now + pause)
    rig.uploaded(1)
    assert rig.uploads[0].begun_at == (0.0 if is_same else rig.now)


@pytest.mark.parametrize(
    ("again", "is_same"), [([1, 2], True), ([1, 3], False), ([2, 2], False), ([1], True)]
)
def test_a_try_with_other_items_is_another_upload(again: list[int], is_same: bool) -> None:
    rig = Rig().count(2)
    for seq, north in enumerate([1, 2]):
        rig.item(seq, north=north)
    rig.said()
    rig.receiver.finish(Result.DENIED, opaque_id=0, now=rig.now)
    rig.run(1.0)
    rig.count(len(again))
    rig.run(1.0 + QUIET)
    for seq, north in enumerate(again):
        rig.item(seq, north=north)
    rig.said()
    assert rig.uploads[-1].begun_at == (0.0 if is_same else 1.0)


@pytest.mark.parametrize(("north", "is_same"), [(1, True), (2, False)])
def test_a_try_that_begins_otherwise_than_a_refused_item_is_another_upload(
    north: int, is_same: bool
) -> None:
    rig = Rig(refused=16).count(1)
    rig.item(0, north=1)
    rig.said()
    rig.refused = None
    rig.run(1.0)
    rig.count(1)
    rig.run(1.0 + QUIET)
    rig.item(0, north=north)
    rig.said()
    assert rig.uploads[0].begun_at == (0.0 if is_same else 1.0)


def test_items_without_a_value_are_the_same_again() -> None:
    rig = Rig()
    for begun in (0.0, 1.0):
        rig.run(begun)
        rig.count(1)
        rig.run(begun + QUIET)
        message = item(0)
        message.param4 = float("nan")
        rig.receiver.item(message, ALICE, now=rig.now)
        rig.said()
        rig.receiver.finish(Result.DENIED, opaque_id=0, now=rig.now)
    assert [upload.begun_at for upload in rig.uploads] == [0.0, 0.0]


def test_a_count_that_comes_again_counts_from_the_first() -> None:
    rig = Rig().count(2)
    rig.run(1.0)
    rig.count(1)
    rig.run(1.0 + QUIET)
    rig.item(0)
    rig.said()
    assert rig.uploads[0].begun_at == 0.0


def test_an_upload_after_one_that_was_accepted_counts_from_itself() -> None:
    rig = Rig().uploaded(2)
    rig.receiver.finish(Result.ACCEPTED, opaque_id=7, now=0.0)
    rig.run(1.0)
    rig.uploaded(2)
    assert [upload.begun_at for upload in rig.uploads] == [0.0, 1.0]


def test_after_a_client_has_given_up_nothing_more_is_asked() -> None:
    rig = Rig().count(2)
    rig.item(0)
    rig.said()
    rig.cancel()
    assert rig.run(5.0) == []
    rig.count(1, BOB)
    assert rig.said() == [("bob", "request", 0)]


def test_the_end_of_a_download_cancels_no_upload() -> None:
    rig = Rig().count(2)
    rig.said()
    rig.receiver.cancelled(m.MissionAck(1, 1, Result.ACCEPTED, MISSION), ALICE, now=0.0)
    rig.item(0)
    assert rig.said() == [("alice", "request", 1)]


def test_somebody_elses_ack_cancels_nothing() -> None:
    rig = Rig().count(2)
    rig.cancel(BOB)
    rig.item(0)
    assert ("alice", "request", 1) in rig.said()


def test_another_type_from_the_same_client_is_another_upload() -> None:
    rig = Rig().count(2)
    rig.item(0)
    rig.said()
    rig.count(1, kind=FENCE)
    assert rig.said() == [("alice", "request", 0)]
    rig.item(0)  # of the mission
    assert rig.said() == []
    rig.item(0, kind=FENCE)
    rig.said()
    assert rig.uploads[0].mission_type == FENCE


def test_the_last_item_again_is_acknowledged_again() -> None:
    rig = Rig().uploaded(2)
    rig.receiver.finish(Result.ACCEPTED, opaque_id=7, now=0.0)
    rig.said()
    rig.now = 1.0
    rig.item(1)
    assert rig.said() == [("alice", "ack", Result.ACCEPTED)]
    rig.item(1, north=9)  # another one: it belongs to nothing
    assert rig.said() == []
    rig.now = 3.0
    rig.item(1)
    assert rig.said() == []


def test_an_item_out_of_nowhere_changes_nothing() -> None:
    rig = Rig()
    rig.item(0)
    assert (rig.said(), rig.uploads) == ([], [])


def test_too_many_items_are_refused_at_once() -> None:
    rig = Rig().count(CAPACITY + 1)
    assert rig.said() == [("alice", "ack", Result.NO_SPACE)]
    assert rig.receiver.next_deadline() is None


@pytest.mark.parametrize("x", [float("inf"), 1e30, float("nan")])
def test_a_place_beyond_all_numbers_is_refused(x: float) -> None:
    rig = Rig().count(1)
    rig.said()
    message = m.MissionItem(1, 1, 0, 3, 16, 0, 1, 0, 0, 0, 0, x, 8.0, 0, MISSION)
    rig.receiver.item(message, ALICE, now=0.0)
    is_none = x != x  # which stands for "not given", and is for the check to judge
    assert rig.said() == ([] if is_none else [("alice", "ack", Result.INVALID_PARAM5_X)])


def test_the_float_form_means_the_same_place() -> None:
    rig = Rig().count(2)
    for seq, frame, x in ((0, 3, 47.0), (1, 1, -2.5)):
        message = m.MissionItem(1, 1, seq, frame, 16, 0, 1, 0, 0, 0, 0, x, 8.0, 0, MISSION)
        rig.receiver.item(message, ALICE, now=0.0)
    rig.said()
    assert [(i.x, i.y) for i in rig.uploads[0].items] == [(470000000, 80000000), (-25000, 80000)]


class TestForms:
    """How items are asked for: as the autopilot does, and on repeats the other way as well."""

    @staticmethod
    def plain(seq: int) -> m.MissionItem:
        return m.MissionItem(1, 1, seq, 3, 16, 0, 1, 0, 0, 0, 0, 47.0, 8.0, 0, MISSION)

    def test_an_ardupilot_asks_plainly_and_each_second_time_for_an_int_item(self) -> None:
        rig = Rig(form=m.MissionRequest)
        rig.count(2).said()
        rig.run(4.5 * ASK_AGAIN)
        assert rig.forms == [m.MissionRequest, m.MissionRequestInt] * 2 + [m.MissionRequest]

    def test_a_px4_asks_four_times_for_an_int_item_before_it_asks_plainly(self) -> None:
        rig = Rig()
        rig.count(2).said()
        rig.run(6.5 * ASK_AGAIN)
        assert rig.forms[:4] == [m.MissionRequestInt] * 4
        assert rig.forms[4:] == [m.MissionRequest, m.MissionRequestInt, m.MissionRequest]

    def test_a_client_that_has_sent_int_items_to_a_px4_is_never_asked_plainly(self) -> None:
        rig = Rig()
        rig.count(2).said()
        rig.item(0)
        rig.run(GIVE_UP - 0.1)
        rig.count(2).said()
        rig.run(2 * GIVE_UP)
        assert set(rig.forms) == {m.MissionRequestInt}
        assert len(rig.forms) > 10

    def test_a_client_that_answers_one_form_only_is_asked_for_the_next_in_it_at_once(self) -> None:
        rig = Rig()
        rig.count(3).said()
        rig.run(4 * ASK_AGAIN)
        assert rig.forms[-1] is m.MissionRequest
        for seq in range(3):
            rig.receiver.item(self.plain(seq), ALICE, now=rig.now)
            rig.said()
        assert rig.forms[4:] == [m.MissionRequest] * 3
        assert len(rig.uploads[0].items) == 3
