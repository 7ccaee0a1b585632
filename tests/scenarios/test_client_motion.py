"""What clients may do to a rover besides giving it tasks: commands that move, modes, arming."""

from math import nan

import pytest

from mav_tasks.config.settings import Settings
from mav_tasks.tasks.lifecycle import TaskReason as R
from rover_sim.personas import ARDUPILOT, Mode
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, DENIED, GUIDED, HOLD, setpoint
from tests.kit.world import World, at
from tests.scenarios.conftest import MakeWorld

GLOBAL = 0  # MAV_FRAME
REPOSITION = 192


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
    assert world.mode() is Mode.GUIDED
    assert world.truth.forward_speed > 0.4


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
    assert (world.is_armed, world.stands()) == (True, True)


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
        assert world.client.said("the rover is not armed")
        takes_control(world)
        assert self.go_to(world) == (ACCEPTED, 0)
        assert world.tasks() == ()
