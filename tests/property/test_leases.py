"""Leases of gateways under faults: never two that move a vehicle, and never none for long."""

from random import Random

import pytest

from mav_tasks.fleet.lease import Terms
from mav_tasks.fleet.member import Member
from mav_tasks.fleet.standing import MAY_STOP, TABLE, Effect, LeaseEvent, Standing, standing_after
from tests.kit.gateways.database import Database
from tests.kit.gateways.world import Process, World
from tests.kit.volume import tries

GATEWAYS = {"a": {1, 2}, "b": {1, 2, 3}, "c": {2, 3}}
SETTLED = 4.0  # s without faults, in which all is well again
SEEDS_AT_ONCE = 100


def disturb(world: World, it: Process) -> None:
    """Do something bad to one gateway, for a while."""
    random, name = world.random, it.member.name
    last = random.uniform(0.05, 4.0)
    match random.randrange(10):
        case 0:
            world.end(it)
            world.at(last, lambda: again(world, name))
        case 1:
            it.frozen_until = world.now + last
        case 2 | 3:
            hears = random.random() < 0.5
            world.cut(it, hears=hears, reaches=not hears or random.random() < 0.5)
            world.at(last, lambda: world.cut(it, hears=True, reaches=True))
        case 4:
            world.end_session(it)
        case 5:
            it.is_reached_by_peers = False
            world.at(last, lambda: setattr(it, "is_reached_by_peers", True))
        case 6:
            world.database.restart()
            world.database.is_up = False
            world.at(last, lambda: setattr(world.database, "is_up", True))
        case 7 | 8:  # somebody starts a second process of its name; its own session may be lost
            twin = world.add(name, set(GATEWAYS[name]), label=f"{name} again")
            if random.random() < 0.7:
                world.end_session(it)
            world.at(last, lambda: world.end(twin))
        case _:
            heard = it.member.heard
            heard.discard(random.choice(sorted(heard or {0})))
            world.at(last, lambda: heard.update(GATEWAYS[name]))


def again(world: World, name: str) -> None:
    """Start a gateway's process again."""
    if world.processes[name].is_dead:
        world.add(name, set(GATEWAYS[name]))


def life(seed: int) -> World:
    """Let a fleet live for a while, with faults until shortly before the end."""
    random = Random(seed)
    world = World(random)
    for name, heard in GATEWAYS.items():
        world.add(name, set(heard))
    world.run(2.0)
    for _ in range(random.randrange(1, 8)):
        disturb(world, random.choice(list(world.processes.values())))
        world.run(random.expovariate(1.0))
    world.run(4.0)  # each fault is over
    for name in GATEWAYS:
        again(world, name)
    world.slow = 0.0
    world.run(SETTLED)
    return world


@pytest.mark.parametrize("first", range(0, tries(100, long=10_000), SEEDS_AT_ONCE))
def test_no_gateway_moves_what_another_one_holds_and_all_are_held_again(first: int) -> None:
    freed = 0
    for seed in range(first, first + SEEDS_AT_ONCE):
        world = life(seed)
        assert not world.wrong, f"seed {seed}: {world.wrong[:3]}"
        assert world.motions > 50, f"seed {seed}"
        for vehicle in range(1, world.vehicles + 1):
            holder = world.database.holder(vehicle)
            assert holder is not None, f"seed {seed}: nobody holds {vehicle}"
            it = world.processes[holder]
            lease = it.member.lease
            assert lease.may_move(vehicle, world.local(it)), f"seed {seed}: {vehicle}, {lease}"
            assert vehicle in it.served, f"seed {seed}: {vehicle}, {it.served}"
            assert vehicle in it.member.heard, f"seed {seed}: {vehicle}, {it.member.heard}"
        freed += world.freed
    assert freed > 0


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


def taken_after(seed: int, *, is_killed: bool) -> float:
    """Return how long a vehicle had no holder that moves it, after its gateway died."""
    world = World(Random(seed), vehicles=1, slow=0.0)
    for name in ("a", "b"):
        world.add(name, {1})
    world.run(2.0 + world.random.random())
    holder = world.processes[world.database.holder(1) or ""]
    (other,) = [it for it in world.processes.values() if it is not holder]
    if is_killed:
        world.end(holder)
    else:  # a silent death: its machine is off
        holder.is_reached_by_peers = False
        world.cut(holder, hears=False, reaches=False)
        holder.is_dead = True
    died = world.now
    while not other.member.lease.may_move(1, world.local(other)):
        world.run(0.005)
        assert world.now - died < 5.0
    assert not world.wrong
    return world.now - died


@pytest.mark.parametrize(("is_killed", "limit"), [(True, 0.3), (False, 1.5)])
def test_another_gateway_has_the_vehicle_in_time(is_killed: bool, limit: float) -> None:
    """Of 100 takeovers 99 within the limit of virtual time, without PostgreSQL's own time."""
    took = sorted(taken_after(seed, is_killed=is_killed) for seed in range(100))
    assert took[98] <= limit, took[-5:]


def test_a_second_process_of_one_name_waits_for_the_first_ones_term() -> None:
    """The first may have lost its session without noticing, and be driving."""
    for seed in range(20):
        world = World(Random(seed), vehicles=1)
        first = world.add("a", {1})
        world.run(2.0)
        world.end_session(first)
        world.add("a", {1}, label="second")
        world.run(SETTLED)
        assert not world.wrong, f"seed {seed}: {world.wrong[:3]}"
        assert world.database.holder(1) == "a"


def test_many_vehicles_are_taken_at_once() -> None:
    world = World(Random(1), vehicles=100, slow=0.0)
    world.add("a", set(range(1, 101)))
    world.run(0.5)
    assert len(world.database.rows["a"].holds) == 100


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
