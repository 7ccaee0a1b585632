"""PX4 and generic rovers: armed in HOLD, driven by velocities over ground; what they cannot do."""

from dataclasses import replace
from math import cos, degrees, radians, sin
from struct import pack, unpack

import pytest
from pymavlink.dialects.v20 import common
from pymavlink.generator.mavcrc import x25crc

from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.frames import Frame
from rover_sim.kinematic_bodies import kinematic_body
from rover_sim.personas import PX4, Mode, Persona
from tests.kit.cases import anew, for_each
from tests.kit.mission import reached
from tests.kit.px4 import PROMPT_GENERIC, PROMPT_PX4, go_to
from tests.kit.rows import check
from tests.kit.world import World, is_at, near_pose
from tests.scenarios.conftest import MakeWorld

DRIVE = 54002
WAITS = "waits: it might drive on without setpoints"

every = for_each("persona", [PROMPT_PX4, PROMPT_GENERIC])
each = pytest.mark.parametrize("persona", [PROMPT_PX4, PROMPT_GENERIC], ids=lambda p: p.name)


@anew
def world(make_world: MakeWorld) -> World:
    return make_world(persona=PROMPT_PX4)


@for_each("modes, shown", [(1 << 14 | 0b10000, 1 << 14 | 0b11000), (0b101, 0b101), (None, None)])
def test_its_checks_allow_a_mission_wherever_they_allow_hold(
    world: World, modes: int | None, shown: int | None
) -> None:
    """It has no mission itself, and QGroundControl would offer no start of the server's."""

    def payload(can_arm: int | None) -> bytes:
        head = pack("<IIHBBB", 1 << 24 | 11047904, 12_000, 7, 0, 0, 0x8F)
        return head if can_arm is None else head + pack("<BIIII", 0, 3, 0, can_arm, 0b10110)

    packet = bytes((len(payload(modes)), 0, 0, 9, 1, 1, 410 & 0xFF, 410 >> 8, 0)) + payload(modes)
    crc = x25crc(packet + b"\xa0").crc
    world.from_vehicle_side(b"\xfd" + packet + pack("<H", crc), peer="rover1")
    world.run(0.2)
    (event,) = world.client.of_id(410)
    assert event.payload.rstrip(b"\0") == payload(shown).rstrip(b"\0")
    assert pack("<H", x25crc(event.raw[1:-2] + b"\xa0").crc) == event.raw[-2:]


class TestDriving:
    @every
    def test_tasks_are_driven_and_the_rover_is_handed_back(
        self, make_world: MakeWorld, persona: Persona
    ) -> None:
        world = make_world(persona=persona)
        active = world.now
        world.client.move(2.0)
        world.run(0.05)
        go_to(world, -1.0, 2.0)
        world.client.command(DRIVE, 0.5, 0, 2.0)
        world.until_idle(tasks=3, within=90)
        assert world.states() == [S.COMPLETED] * 3
        story = [what for what in world.observer.sent_since(active) if what not in ("511", "512")]
        order = list(dict.fromkeys(story))
        assert order == ["HOLD", "zero", "arm", "stay", "GUIDED", "move", "disarm"]
        assert not world.is_armed
        assert world.mode() is Mode.HOLD

    @for_each("north, east", [(2, 0), (-2, 0), (0, 1.5), (-1, -1), (0.3, 0)])
    def test_a_place_is_driven_to_without_turning_on_the_spot_first(
        self, world: World, north: float, east: float
    ) -> None:
        go_to(world, north, east)
        world.until_idle(tasks=1)
        assert is_at(world, north, east)

    @every
    def test_a_plan_is_driven(self, make_world: MakeWorld, persona: Persona) -> None:
        world = make_world(persona=persona)
        table = """
    mission; TO=1.5,0; TO=1.5,1.5; TO=0,1.5; TO=0,0 : ACCEPTED
    MISSION_START to=autopilot & until 1 COMPLETED within=90 : ACCEPTED #1 / at=0,0,-90
    """
        check(world, table.replace("TO=", "NAV_WAYPOINT at="))
        assert reached(world.client) == [0, 1, 2, 3], "no item is home"


class TestTurning:
    """A differential rover turns on the spot to the course of a set-point of 1 mm/s."""

    @for_each("angle", [90.0, -45.0, 170.0, -270.0, 400.0])
    def test_by_an_angle(self, world: World, angle: float) -> None:
        world.run(2.0)  # until it has said that it can
        check(world, f"TASK_ROTATE {angle} & idle 1 : ACCEPTED task 1: COMPLETED / at=0,0,{angle}")

    def test_it_goes_on_with_a_turn_where_somebody_has_carried_it(self, world: World) -> None:
        check(
            world,
            "wait 2 : -\nTASK_ROTATE 150 & wait 3 : ACCEPTED it MOVES\nPAUSE & wait 3 : ACCEPTED",
        )
        world.rover.push(0.1, 0.0, 0.0)
        check(world, "CONTINUE & until 1 COMPLETED : ACCEPTED")


class TestMovingBackwards:
    """It does not reverse: a differential one turns round, drives, and turns back."""

    @for_each("heading", [0.0, 120.0])
    def test_it_ends_behind_with_the_heading_that_it_had(
        self, make_world: MakeWorld, heading: float
    ) -> None:
        world = make_world(persona=PX4, heading=heading)
        world.run(2.0)
        world.client.move(-1.0)
        world.until_idle(tasks=1, within=60)
        assert world.state(1)[0] is S.COMPLETED
        north, east = -cos(radians(heading)), -sin(radians(heading))
        assert near_pose(world.pose(), (north, east, heading))
        assert world.client.said("it turns round, drives, turns back")


class TestStanding:
    """A real PX4 takes zero velocity for "to the north or south" (1.17, SITL)."""

    @for_each("frame", [Frame.DIFFERENTIAL, Frame.ACKERMANN])
    def test_a_move_begins_and_ends_with_the_heading_that_it_had(
        self, make_world: MakeWorld, frame: Frame
    ) -> None:
        world = make_world(
            persona=PX4.on(frame),
            body=lambda start: kinematic_body(frame, start=start, slip=0.0, seed=None),
            heading=-161.0,
        )
        world.rover.autopilot.parameters["RO_SPEED_P"] = 0.4
        world.rover.autopilot.parameters["RO_SPEED_I"] = 0.5
        world.run(2.0)
        turned: list[float] = []
        world.watch(lambda now: turned.append(abs(degrees(world.truth.yaw) + 161.0)))
        world.client.move(2.0, speed=0.8)
        world.until_idle(tasks=1)
        assert world.state(1)[0] is S.COMPLETED
        assert max(turned) < 5.0, "it is not turned to the north"


def test_what_it_cannot_do_is_refused_with_what_is_wrong(world: World) -> None:
    table = """
TASK_DRIVE -0.5 0 2 : REFUSED / reverse
TASK_DRIVE 0.5 10 2 : REFUSED / yaw rate
NAV_SET_YAW_SPEED 90 -0.5 : REFUSED / reverse
"""
    check(world, table.replace("REFUSED", f"DENIED #{R.NOT_SUPPORTED_BY_VEHICLE}"))
    assert world.tasks() == ()


@every
def test_stop_ends_a_drive(make_world: MakeWorld, persona: Persona) -> None:
    check(
        make_world(persona=persona),
        """
TASK_MOVE 20 1 & faster 0.8 : ACCEPTED
TASK_STOP & wait 4 : ACCEPTED #1 / it STANDS / mode hold / it is IDLE
""",
    )


class TestOneThatWouldDriveByItselfWithoutUs:
    """By its offboard-loss failsafe: nobody could stop it if the server went away."""

    def test_its_tasks_wait_and_say_why_and_what_cures_it(self, make_world: MakeWorld) -> None:
        world = make_world(persona=PROMPT_PX4)
        world.client.send(set_action(3))
        check(
            world,
            f"""
    wait 0.2 : - COM_OBL_RC_ACT is 3: Return, it drives home / stop: mav-tasks probe --set-failsafe
    TASK_MOVE 1 & wait 5 : ACCEPTED #1 / task 1: QUEUED NONE / {WAITS}
    SHOW 1 : ACCEPTED status 1: QUEUED LOSS_FAILSAFE / it is DISARMED
    """,
        )

    def test_one_that_never_says_what_it_does_is_driven_after_it_was_asked_for_a_while(
        self, make_world: MakeWorld
    ) -> None:
        said = tuple(each for each in PX4.parameters if each.name != "COM_OBL_RC_ACT")
        world = make_world(persona=replace(PROMPT_PX4, parameters=said))
        check(
            world,
            """
    TASK_MOVE 1 & wait 1 : ACCEPTED
    SHOW 1 : ACCEPTED status 1: QUEUED LOSS_FAILSAFE
    idle 1 : - task 1: COMPLETED
    """,
        )


def set_action(action: int) -> common.MAVLink_param_set_message:
    """COM_OBL_RC_ACT as clients of a PX4 set it: an INT32 by its bytes."""
    (wire,) = unpack("<f", pack("<i", action))
    return common.MAVLink_param_set_message(1, 1, b"COM_OBL_RC_ACT", wire, 6)
