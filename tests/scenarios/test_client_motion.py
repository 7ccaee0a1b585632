"""What clients may do to a rover besides giving it tasks: commands that move, modes, arming."""

from mav_tasks.config.settings import Settings
from rover_sim.personas import ARDUPILOT, Mode
from tests.kit.cases import for_each
from tests.kit.client import GUIDED, HOLD, setpoint
from tests.kit.rows import check
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld


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
    check(
        world,
        """
wait 1 : - it MOVES
TASK_STOP & wait 3 : ACCEPTED
CONTINUE : ACCEPTED
other> DO_SET_MODE 1 15 to=autopilot & wait 0.5 : ACCEPTED
other> ARM 1 & wait 2 : ACCEPTED it is ARMED / it STANDS
""",
        other=world.add_client("other"),
    )


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


def test_unclaimed_a_go_to_is_the_rovers_own_once_it_is_armed(make_world: MakeWorld) -> None:
    """The setting ``claim`` is off: what goes to the autopilot is the client's own business."""
    world = make_world(settings=Settings(claim=False))
    go = "DO_REPOSITION -1 1 0 nan at=1,0 frame=0 to=autopilot"
    check(world, f"{go} : NOT_ALLOWED / the rover is not armed")
    takes_control(world)
    check(world, f"{go} : ACCEPTED #0")
    assert world.tasks() == ()
