"""What waited while the server stood still is old: halts in it count, nothing else moves a rover.

Attack D4: after 20 s of standstill a continue came after a newer STOP, sticks and a forced arming
of 20 s ago reached the rover, and a submission was driven that its client had given up on.
"""

from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Mode
from tests.kit.cases import for_each
from tests.kit.client import (
    ACCEPTED,
    ARM,
    GUIDED,
    HOLD,
    MANUAL,
    PAUSE_CONTINUE,
    SET_MODE,
    TEMPORARILY_REJECTED,
    command_long,
    rc_override,
    set_mode,
    setpoint,
    sticks,
)
from tests.kit.world import World

STOOD = 20.0  # s
CANCEL = 54010
MOVING = {11, 69, 70, 84}  # SET_MODE, sticks, and set-points


def in_the_standstill(world: World, *words: object) -> None:
    """Let a client send words while the server stands still, and the server go on."""
    world.leave(world.server)
    world.watched.is_server_away = True
    world.run(1)
    for word in words:
        world.client.send(word)
        world.run(0.2)
    world.run(STOOD)
    world.watched.is_server_away = False
    world.join(world.server)


def moved(world: World, seconds: float) -> float:
    """Return the metres that the rover gets from here."""
    north, east, _ = world.pose()
    world.run(seconds)
    return abs(world.pose()[0] - north) + abs(world.pose()[1] - east)


@for_each("halt", ["STOP", "HOLD"])
def test_a_continue_from_before_a_stop_does_not_go_on_after_it(world: World, halt: str) -> None:
    person = world.add_client("person")
    world.client.move(20)
    world.until_state(1, S.EXECUTING)
    world.client.pause()
    world.run(4)
    world.leave(world.server)
    world.watched.is_server_away = True
    world.client.send(command_long(PAUSE_CONTINUE, 1))
    world.run(1)
    person.stop() if halt == "STOP" else person.mode(HOLD)
    world.run(STOOD)
    world.watched.is_server_away = False
    world.join(world.server)
    assert moved(world, 4) < 0.001
    assert world.paused() is (R.STOPPED if halt == "STOP" else R.OPERATOR)


def test_a_halt_in_the_backlog_counts(world: World) -> None:
    world.client.move(20)
    world.until_state(1, S.EXECUTING)
    in_the_standstill(world, command_long(54003))
    world.run(0.5)
    assert world.paused() is R.STOPPED
    assert moved(world, 3) < 0.001


@for_each(
    "mode, words",
    [
        (Mode.MANUAL, [sticks(0, 0, 800)] * 50),
        (Mode.MANUAL, [rc_override(1500, 1500, 1900)] * 5),
        (Mode.HOLD, [set_mode(MANUAL), sticks(0, 0, 800), sticks(0, 0, 800)]),
        (Mode.HOLD, [command_long(SET_MODE, 1, GUIDED, target=(1, 1)), *[setpoint(1.0)] * 20]),
        (Mode.GUIDED, [setpoint(1.0)] * 20),
    ],
)
def test_old_sticks_modes_and_set_points_do_not_move_an_armed_rover(
    world: World, mode: Mode, words: list[object]
) -> None:
    if mode is Mode.GUIDED:
        world.client.mode(GUIDED)
    else:
        world.operator_mode(mode)
    world.run(1)
    world.operator_arm(True)
    world.run(1)
    passed = world.passed_on((255, 190))
    in_the_standstill(world, *words)
    assert moved(world, 3) < 0.001
    assert world.mode() is mode
    assert not passed & MOVING


def test_an_old_forced_arming_does_not_arm(world: World) -> None:
    in_the_standstill(world, command_long(ARM, 1, 21196, target=(1, 1)))
    world.run(1)
    assert not world.is_armed


@for_each("seconds", [30, 1])
def test_a_submission_that_its_client_has_given_up_on_is_not_driven(
    world: World, seconds: int
) -> None:
    world.leave(world.server)
    world.watched.is_server_away = True
    submitted = world.client.move(2)
    world.run(seconds)
    world.watched.is_server_away = False
    world.join(world.server)
    is_stale = seconds > 1
    assert (moved(world, 5) < 0.001) is is_stale
    assert submitted.answer == ((TEMPORARILY_REJECTED, R.STALE) if is_stale else (ACCEPTED, 1))
    assert len(world.tasks()) == (0 if is_stale else 1)


def test_a_cancel_of_what_is_held_since_lets_nothing_else_go(world: World) -> None:
    """It was driven when its sender called it off; now somebody has to look first."""
    world.client.move(20)
    world.client.move(20)
    world.until_faster(0.3)
    world.observer.expects_gaps = True
    in_the_standstill(world, command_long(CANCEL, 1))
    assert moved(world, 6) < 0.01
    assert world.state(1) == (S.HELD, R.LATE)
    assert world.client.acks_of(CANCEL) == [(TEMPORARILY_REJECTED, R.STALE)]
