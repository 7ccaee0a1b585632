"""A gateway frees a vehicle that only another one hears, and does not take it back at once."""

from mav_tasks.fleet.lease import Terms
from mav_tasks.fleet.member import LEFT_TO_OTHERS, Change, Free, Join, Member, Renew, Row, Take
from mav_tasks.fleet.rivals import Rival

ONE, NONE = frozenset({1}), frozenset[int]()


class Talk:
    """A member that holds vehicle 1, and what the database answers."""

    def __init__(self) -> None:
        self.member = Member("a", Terms(), {1})
        self.now = 0.0
        self.rival = Rival("b", 2, 0, in_session=True)
        self.holds = NONE
        assert isinstance(self.member.request(self.now), Join)
        self.member.answered(Join("a"), Row(1, NONE, ()), sent=self.now, now=self.now)
        self.turn()
        assert self.member.lease.vehicles == {1}

    def turn(self, *, hears: frozenset[int] = NONE) -> Change:
        """Let 0.25 s pass, in which all requests are answered; return what changed last."""
        self.now += 0.25
        last = Change()
        while (request := self.member.request(self.now)) is not None:
            match request:
                case Take(vehicles=vehicles):
                    self.holds |= vehicles - self.rival.holds
                case Free(vehicle=vehicle):
                    self.holds -= {vehicle}
                case Renew():
                    renewals = self.rival.renewals + 1
                    rival = self.rival
                    self.rival = Rival("b", 2, renewals, rival.in_session, rival.holds, hears)
            row = Row(1, self.holds, (self.rival,))
            change = self.member.answered(request, row, sent=self.now, now=self.now)
            last = change if change != Change() else last
        return last

    def is_asked(self, *, hears: frozenset[int] = ONE) -> bool:
        """Return whether the engine is asked to forget the vehicle."""
        return self.turn(hears=hears).lets_go == ((1, "b"),)

    def loses(self) -> None:
        """The vehicle falls silent, and the engine could forget it."""
        self.member.heard = set()
        self.member.strays = ONE


def test_only_what_another_one_hears_is_let_go() -> None:
    it = Talk()
    assert not it.is_asked()  # it is heard
    it.member.heard = set()
    assert not it.is_asked()  # a task runs, perhaps
    it.loses()
    assert not it.is_asked(hears=NONE)
    assert it.is_asked()
    it.rival = Rival("b", 2, 0, in_session=False)
    assert not it.is_asked()  # it could not take it


def test_it_is_freed_only_after_the_engine_has_forgotten_it() -> None:
    it = Talk()
    it.loses()
    assert it.is_asked()
    assert it.is_asked()  # again, until the engine has
    assert it.holds == ONE
    it.member.forgotten(ONE)
    assert not it.member.lease.may_move(1, it.now)
    it.turn(hears=ONE)
    assert it.holds == NONE


def test_one_that_is_heard_before_it_is_freed_stays_and_is_loaded_again() -> None:
    it = Talk()
    it.loses()
    assert it.is_asked()
    it.member.forgotten(ONE)
    it.member.heard = {1}
    assert it.turn(hears=ONE).got == ONE
    assert it.holds == ONE
    assert it.member.lease.vehicles == {1}


def freed() -> Talk:
    it = Talk()
    it.loses()
    it.turn(hears=ONE)
    it.member.forgotten(ONE)
    it.turn(hears=ONE)
    it.member.heard, it.member.strays = {1}, NONE
    return it


def test_it_is_left_to_the_one_that_hears_it_for_a_while() -> None:
    it = freed()
    it.turn(hears=ONE)
    assert it.holds == NONE
    while it.now < LEFT_TO_OTHERS - 1.0:
        it.turn(hears=ONE)
    assert it.holds == NONE
    for _ in range(10):
        it.turn(hears=ONE)
    assert it.holds == ONE


def test_it_is_taken_again_at_once_if_nobody_hears_it_any_more() -> None:
    it = freed()
    it.turn()
    assert it.holds == ONE


def test_it_is_taken_again_at_once_after_somebody_had_it() -> None:
    it = freed()
    it.rival = Rival("b", 2, it.rival.renewals, in_session=True, holds=ONE)
    it.turn()
    it.rival = Rival("b", 2, it.rival.renewals, in_session=True)
    it.turn(hears=ONE)
    assert it.holds == ONE
