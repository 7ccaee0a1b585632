"""A person at the rover, whose hand the server sees late, or takes for its own doing."""

from functools import partial

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.in_memory import VEHICLE_LINK
from mav_tasks.links.memory import MemoryNet
from mav_tasks.settings import Settings
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import ARDUPILOT, PX4, Mode, Persona
from tests.kit.car import Car
from tests.kit.client import ACCEPTED, GUIDED, HOLD, MOVE, command_long, setpoint
from tests.kit.pairs import every_pair
from tests.kit.px4 import PROMPT_PX4
from tests.kit.world import PROMPT, World
from tests.scenarios.attacks.test_late_arming import is_arming, mode_of
from tests.scenarios.attacks.test_late_to_the_rover import catch, mend
from tests.scenarios.attacks.test_left_waiting import ELSEWHERE, RETURN, packed, stays
from tests.scenarios.attacks.test_words_passed_on import go_to
from tests.scenarios.conftest import MakeWorld
from tests.scenarios.test_car import RADIUS, car_profile

CANCEL, CLEAR, SET_MODE, ARM = 54010, 54011, 176, 400
COMMAND_ACK = 77
POSITIONS = (30, 32, 33)  # ATTITUDE, and where it is
MAKES = {"ap": PROMPT, "ap 1 Hz": ARDUPILOT, "px4": PROMPT_PX4, "px4 1 Hz": PX4}
EVERY_MAKE = pytest.mark.parametrize("persona", MAKES.values(), ids=MAKES)
BOTH = [True, False]


def driving(world: World, distance: float = 20.0) -> None:
    """Let a task drive for a while."""
    world.client.move(distance, speed=0.5)
    world.until(lambda: world.truth.forward_speed > 0.45, within=20)
    world.run(2)


@every_pair(persona=MAKES, both_ways=BOTH, seconds=[1.3, 1.6, 2.2], phase=[0.0, 0.25, 0.5, 0.75])
def test_who_takes_it_during_a_short_gap_keeps_it(
    make_world: MakeWorld, persona: Persona, seconds: float, both_ways: bool, phase: float
) -> None:
    """Nobody parks it: the switch stays where it is, and our HOLD must not turn it."""
    world = make_world(persona=persona)
    world.run(phase)
    driving(world)
    world.watched.loses = lambda source, target, _: (
        source == "rover1" or (both_ways and target == "rover1")
    )
    world.run(0.2)
    world.operator_mode(Mode.MANUAL)
    world.run(seconds)
    mend(world)
    world.run(8)
    assert mode_of(world) is Mode.MANUAL
    assert abs(world.truth.forward_speed) < 0.05


@EVERY_MAKE
@pytest.mark.parametrize("lost", [60, 135, 170])
def test_who_takes_it_after_many_packets_were_lost_is_seen(
    make_world: MakeWorld, persona: Persona, lost: int
) -> None:
    """135 lost numbers of 256 look as if the heartbeats after them were older ones."""
    world = make_world(persona=persona)
    driving(world)
    counted: list[str] = []

    def loses(source: str, *_: object) -> bool:
        counted.extend([source] if source == "rover1" else [])
        return source == "rover1" and len(counted) <= lost

    world.watched.loses = loses
    world.until(lambda: len(counted) > lost, within=10)
    world.run(0.2)
    world.operator_mode(Mode.MANUAL)
    world.run(5)
    assert mode_of(world) is Mode.MANUAL
    assert abs(world.truth.forward_speed) < 0.05


@pytest.mark.parametrize("after", [0.05, 0.15, 0.3])
def test_a_hold_that_is_shown_is_not_ours_because_we_once_asked_for_one(
    make_world: MakeWorld, after: float
) -> None:
    world = make_world()
    world.client.move(1, speed=0.5)
    world.until_state(1, S.COMPLETED, within=30)
    world.run(60)
    world.operator_mode(Mode.MANUAL)
    world.run(2)
    world.client.proceed()
    world.run(1)
    asked = catch(world, SET_MODE)
    world.client.move(10, speed=0.5)
    world.until(lambda: bool(asked), within=10)
    world.run(after)
    world.operator_mode(Mode.HOLD)
    world.run(0.05)
    mend(world)
    assert stays(world, 8)


@pytest.mark.parametrize("persona", [PROMPT, PROMPT_PX4, ARDUPILOT], ids=["ap", "px4", "ap 1 Hz"])
@pytest.mark.parametrize("after", [0.05, 0.5, 0.8])
def test_who_holds_a_car_while_a_kill_brakes_it_has_it(
    make_world: MakeWorld, persona: Persona, after: float
) -> None:
    world = make_world(
        persona=persona,
        settings=Settings(profiles=(car_profile(persona),)),
        body=partial(Car, radius=RADIUS),
    )
    world.client.move(20, speed=1.5)
    world.client.move(5, speed=0.5)
    world.until(lambda: world.truth.forward_speed > 1.2, within=20)
    world.client.command(CANCEL, 1, 1)
    world.run(after)
    assert mode_of(world) is not Mode.HOLD
    world.operator_mode(Mode.HOLD)
    world.run(5)
    assert stays(world, 8)


@pytest.mark.parametrize("gap", [0.3, 1.0, 2.5])
def test_a_late_copy_of_our_arming_does_not_undo_a_persons_disarming(
    world: World, gap: float
) -> None:
    kept: list[bytes] = []

    def sees(_source: str, target: str, data: bytes) -> bool:
        kept.extend([data] if target == "rover1" and is_arming(data) else [])
        return False

    world.watched.loses = sees
    world.client.move(20, speed=1.0)
    world.until(lambda: world.truth.forward_speed > 0.5, within=20)
    mend(world)
    world.operator_arm(False)
    world.run(gap)
    world.bring_late(kept[0])
    world.run(4)
    assert not world.rover.autopilot.armed


@pytest.mark.parametrize("halt", ["HOLD", "pause"])
@pytest.mark.parametrize("persona", [PROMPT, ARDUPILOT], ids=["prompt", "at 1 Hz"])
def test_late_news_of_its_start_end_no_hold(
    make_world: MakeWorld, persona: Persona, halt: str
) -> None:
    """A position that is late just after a start looks as if it had started once more."""
    world = make_world(persona=persona, settings=Settings(claim=False))
    person = world.add_client("person")
    world.client.move(2, speed=1.0)
    world.until_state(1, S.COMPLETED, within=60)
    world.run(3)
    world.rover.autopilot.reboot(now=world.now)
    world.run(3.2)
    world.client.arm()
    world.run(0.2)
    world.client.mode(GUIDED)
    world.run(0.2)
    world.client.send(go_to(60, 0))
    positions: list[tuple[float, bytes]] = []

    def sees(source: str, _: str, data: bytes) -> bool:
        is_one = source == "rover1" and data[7] in POSITIONS
        positions.extend([(world.now, data)] if is_one else [])
        return False

    world.watched.loses = sees
    world.run(2.0)
    late = next(data for at, data in reversed(positions) if at <= world.now - 1.2)
    world.watched.loses = lambda _, target, __: target == "rover1"
    if halt == "pause":
        MemoryNet.send(world.net, "rover1", VEHICLE_LINK, late)
        world.run(0.05)
        mend(world)
    halted = person.mode(HOLD) if halt == "HOLD" else person.pause()
    world.run(0.3)
    if halt == "HOLD":
        MemoryNet.send(world.net, "rover1", VEHICLE_LINK, late)
        world.run(0.3)
        mend(world)
    world.run(8)
    assert halted.result == ACCEPTED
    assert mode_of(world) is Mode.HOLD
    assert abs(world.truth.forward_speed) < 0.05


@EVERY_MAKE
def test_a_rover_that_is_silent_before_its_task_has_moved_it_ends_no_server(
    make_world: MakeWorld, persona: Persona
) -> None:
    world = make_world(persona=persona)
    world.operator_mode(Mode.HOLD)
    world.operator_arm(True)
    world.run(2)
    world.client.move(10, speed=0.5)
    world.until(lambda: world.state(1)[0] is S.STARTING, within=10)
    world.watched.loses = lambda source, target, _: "rover1" in (source, target)
    world.run(6)
    mend(world)
    world.run(8)
    paused = world.client.pause()
    world.run(0.3)
    assert paused.result == ACCEPTED
    assert world.state(1)[0] is S.PAUSED


@pytest.mark.parametrize("word", [command_long(CANCEL, 0), command_long(CLEAR, 1)])
@pytest.mark.parametrize("late", [0.1, 0.5, 0.8])
def test_a_return_from_before_its_task_was_called_off(
    world: World, word: common.MAVLink_message, late: float
) -> None:
    """It comes while the rover still rolls out."""
    person = world.add_client("person", system_id=245)
    world.observer.expects_late_modes = True
    world.client.move(60, speed=0.5)
    world.until(lambda: world.truth.north > 8, within=40)
    caught = catch(world, RETURN)
    world.client.send(command_long(RETURN, target=ELSEWHERE))
    world.run(0.1)
    mend(world)
    person.send(word)
    world.run(late)
    world.bring_late(caught[0])
    world.run(5)
    assert mode_of(world) is not Mode.RTL
    assert stays(world, 3)


def test_a_second_controller_takes_a_streaming_client_the_rover(world: World) -> None:
    world.client.mode(GUIDED)
    world.client.arm()
    world.run(1.5)
    for _ in range(5):
        world.from_vehicle_side(packed(setpoint(0.0)))
        world.run(0.2)
    world.client.stream(setpoint(0.5), rate=10)
    world.run(4)
    assert abs(world.truth.north) < 0.1


@every_pair(
    persona=MAKES,
    shows_on_request=BOTH,
    word=["a task", "a continue", "the next task"],
    phase=[0.0, 0.2, 0.4, 0.6, 0.8],
)
def test_who_takes_it_just_before_we_do_keeps_it(
    make_world: MakeWorld, persona: Persona, shows_on_request: bool, word: str, phase: float
) -> None:
    """The last heartbeat may be a second old: it does not show whose the rover is now."""
    world = make_world(persona=persona, shows_on_request=shows_on_request)
    if word != "a task":
        driving(world)
        if word == "a continue":
            world.client.pause()
        else:
            world.client.command(CANCEL, 1)
    world.run(6 + phase)
    world.operator_mode(Mode.MANUAL)
    world.operator_arm(True)
    world.run(0.05)
    if word == "a continue":
        world.client.proceed()
    else:
        world.client.move(2.0)
    assert stays(world, 6)
    assert mode_of(world) is Mode.MANUAL


@pytest.mark.parametrize("persona", [ARDUPILOT, PX4], ids=["ap", "px4"])
@pytest.mark.parametrize("phase", [0.0, 0.2, 0.4, 0.6, 0.8])
def test_who_takes_it_while_the_server_stands_still_keeps_it(
    make_world: MakeWorld, persona: Persona, phase: float
) -> None:
    """Its receive buffer is full of what came first, and what shows who has the rover is lost."""
    world = make_world(persona=persona, shows_on_request=False)
    world.client.arm()
    world.run(3 + phase)
    world.client.command(MOVE, 2.0, 0, 0, 0, 0, 6.0, 5)
    world.run(1)
    world.suspend_server(2)
    world.watched.loses = lambda source, *_: source == "rover1"
    world.operator_mode(Mode.MANUAL)
    world.operator_arm(True)
    world.suspend_server(5)
    mend(world)
    assert stays(world, 6)
    assert mode_of(world) is Mode.MANUAL


@every_pair(
    persona={"px4 1 Hz": PX4, "px4": PROMPT_PX4},
    word=["a task", "a continue"],
    after=[0.25, 0.45, 0.65, 0.85, 1.05],
    phase=[0.0, 0.35, 0.7],
)
def test_who_takes_it_while_zeros_lead_in_keeps_it(
    make_world: MakeWorld, persona: Persona, word: str, after: float, phase: float
) -> None:
    """A second passes between the heartbeat that shows it armed and the request for our mode."""
    world = make_world(persona=persona)
    if word == "a continue":
        driving(world)
        world.client.pause()
    world.run(6 + phase)
    if word == "a continue":
        world.client.proceed()
    else:
        world.client.move(3.0)
    world.run(after)
    world.operator_mode(Mode.MANUAL)
    assert stays(world, 6)
    assert mode_of(world) is Mode.MANUAL


@every_pair(persona=MAKES, shows_on_request=BOTH, seconds=[4.0, 8.0, 20.0], phase=[0.0, 0.3, 0.6])
def test_who_drives_and_parks_it_unheard_before_we_take_it_keeps_it(
    make_world: MakeWorld, persona: Persona, shows_on_request: bool, seconds: float, phase: float
) -> None:
    """The task was lost before anything was asked for; disarmed and in its mode it is as before."""
    world = make_world(persona=persona, shows_on_request=shows_on_request)
    world.run(3 + phase)
    world.watched.loses = lambda source, target, _: "rover1" in (source, target)
    world.run(0.05)
    world.client.move(5.0)
    mode = mode_of(world)
    world.run(1.0)
    world.operator_mode(Mode.MANUAL)
    world.operator_arm(True)
    world.run(0.2)
    world.rover.autopilot.operator_sticks(0.8, 0.0)
    world.run(seconds / 2 - 0.6)
    world.rover.autopilot.operator_sticks(0.0, 0.0)
    world.run(seconds / 2 - 0.6)
    world.operator_arm(False)
    world.operator_mode(mode)
    mend(world)
    assert stays(world, 14)
    assert not world.rover.autopilot.armed


@every_pair(
    persona={"px4": PROMPT_PX4, "px4 1 Hz": PX4},
    shows_on_request=BOTH,
    halt=["pause", "cancel"],
    after=[0.02, 0.1, 0.3, 0.6],
)
def test_a_halt_while_it_is_being_taken_stops_its_way_to_a_place(
    make_world: MakeWorld, persona: Persona, shows_on_request: bool, halt: str, after: float
) -> None:
    """In HOLD a PX4 drives to where a client has sent it, whatever zeros it hears."""
    settings = Settings(claim=False)
    world = make_world(persona=persona, shows_on_request=shows_on_request, settings=settings)
    person = world.add_client("person")
    world.client.move(5)
    world.until_idle(tasks=1)
    world.run(3)
    world.client.arm()
    world.run(1)
    world.client.send(go_to(60, 0))
    world.run(4.5)
    speed = world.truth.forward_speed
    world.client.move(3)
    world.run(after)
    said = person.pause() if halt == "pause" else person.command(CANCEL, 2)
    north = world.truth.north
    world.run(12)
    assert speed > 3
    assert said.result == ACCEPTED
    assert world.truth.north - north < 20  # by STOP, too, 14 to 18 m
    assert abs(world.truth.forward_speed) < 0.05


@every_pair(
    persona={"ap": ARDUPILOT, "px4": PX4},
    answers=[1, 3],
    after=[0.05, 0.15, 0.3],
    phase=[0.0, 0.25, 0.5, 0.75],
)
def test_who_takes_it_while_the_answer_to_our_mode_is_lost_keeps_it(
    make_world: MakeWorld, persona: Persona, answers: int, after: float, phase: float
) -> None:
    """It has done as it was asked, and the copy of what was not answered would do it again."""
    world = make_world(persona=persona, shows_on_request=False)
    world.client.move(10.0)
    world.until(lambda: world.truth.forward_speed > 0.45, within=30)
    world.client.pause()
    world.run(6 + phase)
    lost: list[bytes] = []

    def loses(source: str, _target: str, data: bytes) -> bool:
        is_answer = source == "rover1" and data[7] == COMMAND_ACK
        if is_answer and answered(data) in (SET_MODE, ARM) and len(lost) < answers:
            lost.append(data)
            return True
        return False

    world.watched.loses = loses
    world.client.proceed()
    world.until(lambda: world.rover.autopilot.mode is Mode.GUIDED, within=10)
    world.run(after)
    world.operator_mode(Mode.MANUAL)
    before = world.truth.north
    world.run(8)
    assert abs(world.truth.north - before) < 0.3, "it rolls out, and no more"
    assert lost


def answered(data: bytes) -> int:
    """Return which command an answer of MAVLink 2 is to."""
    return int.from_bytes(data[10:12], "little")
