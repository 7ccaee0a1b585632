"""Links that come and go all the time, and a net that changes the order of what it carries."""

from mav_tasks.links.memory import Conditions
from mav_tasks.shell.in_memory import CLIENT_LINK, VEHICLE_LINK
from mav_tasks.tasks.events import VehicleNoted
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.cases import anew, for_each
from tests.kit.client import ACCEPTED, MOVE, ROTATE
from tests.kit.world import World, near_pose
from tests.scenarios.conftest import MakeWorld

LENGTH = 4.0  # m


def flaps(world: World, names: set[str], *, down: float, up: float) -> None:
    """From now on a link carries nothing for ``down`` s, all for ``up`` s, again and again."""
    since = world.now

    def loses(source: str, target: str, _data: bytes) -> bool:
        is_down = (world.now - since) % (down + up) < down
        return is_down and {source, target} == names

    world.watched.loses = loses


@anew
def driving(world: World) -> World:
    """A rover on its way, 4 m."""
    world.client.move(LENGTH)
    world.until_faster(0.4)
    return world


ROVER = {VEHICLE_LINK, "rover1"}
CLIENT = {CLIENT_LINK, "client"}


def test_a_rover_that_is_gone_for_moments_is_driven_on(driving: World) -> None:
    world = driving
    flaps(world, ROVER, down=0.25, up=0.75)
    world.observer.expects_gaps = True
    world.until_idle(tasks=1)
    assert world.history(1)[-2:] == [(S.EXECUTING, R.NONE), (S.COMPLETED, R.NONE)]
    assert near_pose(world.pose(), (LENGTH, 0.0, 0.0))


def test_a_rover_that_is_never_back_for_2_s_is_not_driven_again_and_given_up_after_30_s(
    driving: World,
) -> None:
    world = driving
    since = world.now
    flaps(world, ROVER, down=1.5, up=1.5)
    world.until_state(1, S.PAUSED, within=1.5)
    world.until(world.stands, within=4)
    assert "move" not in world.observer.sent_since(since + 0.35)
    where = world.pose()
    world.until_state(1, S.FAILED, within=32)
    assert world.state(1) == (S.FAILED, R.LINK_TIMEOUT)
    assert world.paused() is R.LINK_TIMEOUT
    assert near_pose(world.pose(), where, metres=0.005)
    assert "move" not in world.observer.sent_since(since + 0.35)


def test_a_rover_that_is_back_for_longer_gets_on_each_time_and_arrives(driving: World) -> None:
    world = driving
    flaps(world, ROVER, down=1.5, up=6.0)
    world.until_idle(tasks=1, within=120)
    history = world.history(1)
    assert history[-1] == (S.COMPLETED, R.NONE)
    assert history.count((S.PAUSED, R.POSITION_LOST)) >= 2
    assert near_pose(world.pose(), (LENGTH, 0.0, 0.0))


def test_a_client_that_is_gone_every_second_second_loses_no_task_and_doubles_none(
    world: World,
) -> None:
    flaps(world, CLIENT, down=1.0, up=1.0)
    repeats = tuple(0.3 * step for step in range(15))
    sent = []
    for number in range(1, 6):  # one after the other: an ack names no more than the command
        sent.append(world.client.move(0.4, nonce=number, repeats=repeats))
        world.until(lambda: sent[-1].answer, within=3)
    world.until_idle(tasks=5)
    assert [each.answer for each in sent] == [(ACCEPTED, number) for number in range(1, 6)]
    assert world.states() == [S.COMPLETED] * 5
    assert near_pose(world.pose(), (5 * 0.4, 0.0, 0.0))
    stop = world.client.stop(repeats=repeats)
    world.run(1.1)
    assert stop.result == ACCEPTED


@for_each("seed", range(3))
def test_what_is_reordered_and_doubled_changes_nothing(make_world: MakeWorld, seed: int) -> None:
    """A fifth of a second of disorder at 20 Hz: everything is overtaken by what came later."""
    net = Conditions(delay=0.002, jitter=0.2, duplication=0.5)
    world = make_world(seed=seed, conditions=net)
    world.observer.expects_gaps = True
    for number, (command, param) in enumerate(((MOVE, 1.0), (ROTATE, 90.0), (MOVE, 0.5)), 1):
        sent = world.client.command(command, param, 0, 0, number)
        world.run(0.6)  # what is sent at once need not arrive in its order
        assert sent.answer == (ACCEPTED, number)
    world.until_idle(tasks=3)
    for number in (1, 2, 3):
        states = [state for state, _ in world.history(number)]
        assert states == [S.STARTING, S.EXECUTING, S.COMPLETED]
    assert world.events(VehicleNoted) == []  # neither restarted, nor taken over
    assert near_pose(world.pose(), (1.0, 0.5, 90.0), angle=3.0)
