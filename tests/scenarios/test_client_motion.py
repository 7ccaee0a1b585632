"""What clients may do to a rover besides giving it tasks: commands that move, modes, arming."""

from math import nan

import pytest

from mav_tasks.settings import Settings, Watch
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import ARDUPILOT, Mode
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, DENIED, GUIDED, HOLD, RTL, heartbeat, setpoint
from tests.kit.world import World, at, is_at, put_home
from tests.scenarios.conftest import MakeWorld

GLOBAL = 0  # MAV_FRAME
REPOSITION, MOTOR_TEST, ORBIT, FOLLOW, TAKEOFF = 192, 209, 34, 32, 22


def takes_control(world: World) -> None:
    """The client asks for GUIDED and arms."""
    world.client.mode(GUIDED)
    world.run(0.5)
    world.client.arm(True)
    world.run(0.5)


@for_each("gap", [0.0, 0.05, 0.3, 1.2])
def test_our_mode_asked_for_right_after_hold_is_not_undone(
    make_world: MakeWorld, gap: float
) -> None:
    world = make_world(persona=ARDUPILOT)  # shows a change within a second
    world.client.mode(HOLD)
    world.run(gap)
    world.client.arm(True)
    sent = world.client.mode(GUIDED)
    world.run(0.3)
    world.client.stream(setpoint(0.5), rate=20)
    world.run(3)
    assert sent.answer is not None
    assert world.rover.autopilot.mode is Mode.GUIDED
    assert world.truth.forward_speed > 0.4


@pytest.mark.parametrize("command", [MOTOR_TEST, ORBIT, FOLLOW])
def test_what_would_move_it_is_refused_while_a_task_drives(world: World, command: int) -> None:
    world.client.move(5)
    world.until_state(1, S.EXECUTING)
    sent = world.client.command(command, 1, 0, 1, target=(1, 1))
    world.run(0.3)
    assert sent.answer == (DENIED, R.NOT_ALLOWED)
    assert str(command) not in world.observer.sent_since(0.0)


def test_a_stop_ends_what_clients_were_granted(world: World) -> None:
    takes_control(world)
    world.client.stream(setpoint(0.5), rate=20)
    world.run(1)
    assert not world.stands()
    world.client.stop()
    world.run(3)
    world.client.proceed()
    world.run(0.5)
    other = world.add_client("other")
    other.mode(GUIDED)
    world.run(0.5)
    other.arm(True)
    world.run(2)
    assert (world.rover.autopilot.armed, world.stands()) == (True, True)


def test_an_operators_heartbeats_reach_the_rover(world: World) -> None:
    at = world.now
    world.client.send(heartbeat())
    world.run(0.1)
    sources = {packet.source for packet in world.observer.reached if packet.at >= at}
    assert (255, 190) in sources, "its own failsafe must see the operator"


@for_each("flags, target", [(1, 191), (0, 1)])
def test_a_go_to_is_now_only_at_the_autopilot_with_a_change_of_mode(
    make_world: MakeWorld, flags: int, target: int
) -> None:
    world = make_world(settings=Settings(guided="now"))
    world.client.move(3)
    world.run(3)
    world.client.command_int(
        REPOSITION, -1, flags, 0, nan, **at(1, 0), frame=GLOBAL, target=(1, target)
    )
    world.run(1)
    assert [world.state(i)[0] for i in (1, 2)] == [S.EXECUTING, S.QUEUED]


def test_what_a_client_said_while_the_server_stood_still_moves_no_rover(world: World) -> None:
    takes_control(world)
    world.observer.expects_gaps = True
    world.client.stream(setpoint(0.5), rate=20)
    world.run(2)
    assert world.truth.forward_speed > 0.4
    world.leave(world.server)
    world.run(1)
    world.client.end_streams()
    world.until(world.stands, within=6)  # by its own time-out
    world.run(1)
    stood_at = world.pose()
    world.join(world.server)
    world.run(3)
    assert world.pose() == stood_at


def test_that_a_rover_is_to_stand_is_passed_on_however_late(world: World) -> None:
    takes_control(world)
    world.observer.expects_gaps = True
    world.client.stream(setpoint(0.5), rate=20)
    world.run(2)
    world.leave(world.server)
    world.run(1.7)
    world.client.end_streams()
    world.client.send(setpoint(0.0))
    world.run(0.1)
    assert world.truth.forward_speed > 0.4
    world.join(world.server)
    world.run(1.2)
    assert world.stands()  # its own time-out would be later


@for_each("seconds", [1.0, 4.0])
def test_tasks_wait_as_long_as_is_set_after_a_clients_setpoints(
    make_world: MakeWorld, seconds: float
) -> None:
    world = make_world(settings=Settings(watch=Watch(other_controller=seconds)))
    takes_control(world)
    world.client.stream(setpoint(0.3), rate=20)
    world.run(1)
    world.client.end_streams()
    end = world.now
    world.client.move(1)
    world.until_state(1, S.EXECUTING)
    assert seconds <= world.now - end < seconds + 1.0


class TestUnclaimed:
    """The setting ``claim`` is off: what goes to the autopilot is the client's own business."""

    @pytest.fixture
    def world(self, make_world: MakeWorld) -> World:
        return make_world(settings=Settings(claim=False))

    def go_to(self, world: World, flags: int = 1) -> tuple[int, int] | None:
        sent = world.client.command_int(
            REPOSITION, -1, flags, 0, nan, **at(1, 0), frame=GLOBAL, target=(1, 1)
        )
        world.run(0.5)
        return sent.answer

    def test_a_go_to_is_the_rovers_own_once_it_is_armed(self, world: World) -> None:
        assert self.go_to(world) == (DENIED, R.NOT_ALLOWED)
        assert any("the rover is not armed" in text for text in world.client.texts())
        takes_control(world)
        assert self.go_to(world) == (ACCEPTED, 0)
        assert world.tasks() == ()

    def test_the_mode_rtl_is_the_rovers_own(self, world: World) -> None:
        world.until(lambda: world.client.heard("HOME_POSITION"), within=10)
        takes_control(world)
        world.client.mode(RTL)
        world.run(2)
        assert (world.tasks(), world.rover.autopilot.mode) == ((), Mode.RTL)


def test_return_hold_return_goes_home(world: World) -> None:
    put_home(world, 0.0, 0.0)
    world.until(lambda: world.client.heard("HOME_POSITION"), within=10)
    world.client.move(4)
    world.until_idle(tasks=1)
    for mode in (RTL, HOLD):
        world.client.mode(mode)
        world.run(1.4)
    sent = world.client.mode(RTL)
    world.run(0.3)
    assert sent.answer == (ACCEPTED, 3)
    world.until_state(3, S.COMPLETED)
    assert is_at(world, 0.0, 0.0)
