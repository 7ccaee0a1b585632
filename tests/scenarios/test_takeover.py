"""Somebody else has the rover: not one more setpoint, and everything waits for continue."""

from collections.abc import Callable
from functools import partial

from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Settings
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Persona
from tests.kit.cases import for_each
from tests.kit.client import (
    packed,
    rc_override,
    setpoint,
    sticks,
)
from tests.kit.px4 import PROMPT_PX4
from tests.kit.rows import ask, check
from tests.kit.world import PROMPT, World
from tests.scenarios.conftest import MakeWorld

ROWS = """operator hold
operator manual
operator auto
operator rtl
DO_SET_MODE 1 10 to=autopilot
DO_SET_MODE 1 0 to=autopilot"""

#: how the rover can be taken from us, by name, or as a row
WAYS: dict[str, Callable[[World], object]] = {
    **{row: partial(ask, text=row) for row in ROWS.splitlines()},
    "disarm at the rover": lambda w: w.operator_arm(False),
    "sticks": lambda w: w.client.send(sticks(x=300)),
    "throttle stick": lambda w: w.client.send(sticks(z=500)),
    "throttle beyond its range": lambda w: w.client.send(sticks(z=32_720)),
    "RC override": lambda w: w.client.send(rc_override(1500, 1500, 1700, 1500)),
    "setpoints of a second server": lambda w: w.from_vehicle_side(packed(setpoint(1.0), 250, 191)),
    "setpoints of anybody": lambda w: w.from_vehicle_side(packed(setpoint(1.0), 9, 9)),
    "our own address": lambda w: w.from_vehicle_side(
        packed(common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3), 250, 191)
    ),
}


@for_each("way", WAYS)
def test_no_more_setpoints_and_task_and_queue_pause(driving: World, way: str) -> None:
    world = driving
    at = world.now
    WAYS[way](world)
    world.until_state(1, S.PAUSED, within=1.2)  # arming shows with the next heartbeat
    world.run(0.1)
    paused_at = world.now
    world.run(5)
    assert world.history(1)[-1] == (S.PAUSED, R.TAKEOVER)
    assert (world.paused(), world.state(2)) == (R.TAKEOVER, (S.QUEUED, R.NONE))
    assert world.observer.sent_since(paused_at) == []
    assert "arm" not in world.observer.sent_since(at)
    told = world.client.texts()
    assert "Task 1 paused: takeover" in told
    assert world.client.statuses(1)[-1].why == (S.PAUSED, R.TAKEOVER)


@for_each("way", list(WAYS)[::3])
def test_continue_resumes_to_the_exact_end_on_the_original_line(driving: World, way: str) -> None:
    WAYS[way](driving)
    check(
        driving,
        """
wait 0.3 & operator hold & wait 4 & CONTINUE & idle 2 : ACCEPTED #1 / task 1: COMPLETED / \
task 2: COMPLETED / at=4,0,90
""",
    )


@for_each("mode", ["manual", "auto", "rtl"])
def test_continue_does_not_take_the_rover_out_of_anothers_hands(driving: World, mode: str) -> None:
    check(
        driving,
        f"""
operator {mode} & wait 1 : -
CONTINUE & wait 2 : BUSY #{R.WRONG_MODE} / task 1: PAUSED TAKEOVER / it gets nothing / mode {mode}
operator hold & wait 3 : -
CONTINUE & idle 2 : ACCEPTED
""",
    )


@for_each("persona, throttle", [(PROMPT, 0), (PROMPT_PX4, 0), (PROMPT_PX4, 500)])
def test_sticks_at_rest_are_no_takeover(
    make_world: MakeWorld, persona: Persona, throttle: int
) -> None:
    """A PX4 takes 500 for no throttle: QGroundControl's, unless its stick is zero at the centre."""
    world = make_world(persona=persona)
    world.client.stream(sticks(z=throttle), rate=10)
    world.client.stream(rc_override(1500, 1500, 1510, 0), rate=10)
    check(world, "TASK_MOVE 2 & wait 3 : ACCEPTED task 1: EXECUTING")
    full_reverse = "client:manual_control 1 0 0 0 0 0 & wait 0.1 : - task 1: PAUSED TAKEOVER"
    check(world, full_reverse if throttle else "until 1 COMPLETED : -")


@for_each("arming", ["server", "operator"])
def test_other_setpoints_make_waiting_tasks_wait(make_world: MakeWorld, arming: str) -> None:
    world = make_world(settings=Settings(arming=arming))
    check(world, "operator hold & operator arms & wait 0.5 : -")
    for _ in range(20):
        world.from_vehicle_side(packed(setpoint(0.3), 9, 9))
        world.run(0.05)
    check(
        world,
        """
TASK_MOVE 1 : ACCEPTED
SHOW 1 : ACCEPTED status 1: QUEUED OTHER_CONTROLLER
wait 3 : - task 1: EXECUTING
""",
    )
