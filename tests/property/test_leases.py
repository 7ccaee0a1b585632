"""Leases of gateways: never two that move a vehicle. The simulation has them at random."""

from mav_tasks.fleet.lease import Terms
from mav_tasks.fleet.member import Member
from mav_tasks.fleet.standing import MAY_STOP, TABLE, Effect, LeaseEvent, Standing, standing_after
from tests.kit.gateways.database import Database

STEP, SETTLED = 0.01, 4.0  # s


def test_the_table_has_a_way_back_and_lets_nobody_move_what_it_does_not_hold() -> None:
    """From each state: what it may send, and that joining or a renewal leads back."""
    assert {standing for standing, _ in TABLE} == set(Standing)
    for (standing, event), (after, effects) in TABLE.items():
        assert after in Standing
        if Effect.STOP in effects:
            assert standing is Standing.HOLDER, "nobody else may have its vehicles"
        if event is LeaseEvent.REFUSED:
            assert after is Standing.EVICTED
            assert Effect.STOP not in effects
    for standing in Standing:
        ways = {standing}
        for _ in range(3):
            ways |= {standing_after(each, event)[0] for each in ways for event in LeaseEvent}
        assert Standing.HOLDER in ways
        assert standing_after(standing, LeaseEvent.LEFT)[0] is Standing.OUT
    assert {Standing.HOLDER, Standing.STOPPING} == MAY_STOP


def ask(member: Member, database: Database, now: float) -> None:
    """Let a gateway ask what it wants to, and have an answer at once."""
    if request := member.request(now):
        answer = database.execute(member.name, request)
        member.answered(request, answer, sent=now, now=now)


def test_a_second_process_of_one_name_waits_for_the_first_ones_term() -> None:
    """The first may have lost its session without noticing, and be driving."""
    database, now = Database(), 0.0
    first, second = (Member("a", Terms(), {1}) for _ in range(2))
    database.connect("a")
    while not first.lease.may_move(1, now):
        ask(first, database, now)
        now += STEP
    database.restart()
    database.connect("a")
    end = now + SETTLED
    while now < end:
        ask(second, database, now)
        first.lease.passed(now)
        assert not (first.lease.may_move(1, now) and second.lease.may_move(1, now))
        now += STEP
    assert second.lease.may_move(1, now)


def test_a_slow_database_still_gives_vehicles() -> None:
    """A renewal is then due after each answer; it must not take all turns."""
    member = Member("a", Terms(), {1})
    now, database = 0.0, Database()
    database.connect("a")
    for _ in range(10):
        request = member.request(now)
        if request is not None:
            sent, now = now, now + 0.3
            member.answered(request, database.execute("a", request), sent=sent, now=now)
            assert now < member.lease.trusted_until
    assert member.lease.may_move(1, now)


def test_trust_and_term_count_from_the_moment_at_which_a_renewal_was_sent() -> None:
    member, database, terms = Member("a", Terms(), {1}), Database(), Terms()
    database.connect("a")
    sent = 0.0
    for number in range(4):  # joins, takes the vehicle, renews twice
        sent, late = 0.3 * number, 0.3 * number + 0.25
        request = member.request(sent)
        assert request is not None
        member.answered(request, database.execute("a", request), sent=sent, now=late)
    trusted, end = sent + terms.term - terms.margin, sent + terms.term
    assert member.lease.may_move(1, trusted - 0.01)
    assert not member.lease.may_move(1, trusted)
    assert member.lease.may_stop(1, end - 0.01)
    assert not member.lease.may_stop(1, end)
