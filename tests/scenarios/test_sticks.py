"""The throttle stick of the rover's own transmitter, held forward while the server drives."""

from functools import partial

from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.frames import Frame
from rover_sim.kinematic_bodies import kinematic_body
from tests.kit.cases import for_each
from tests.kit.rows import check
from tests.kit.world import PROMPT, World
from tests.scenarios.conftest import MakeWorld

CANCEL = 54010
FORWARD, CENTRE, BACK = 1750, 1500, 1250  # µs: 1.9 m/s by itself, on a rover of 4 m/s
STANDS = 0.03  # m/s


def with_transmitter(make_world: MakeWorld, frame: Frame) -> World:
    """A world whose ArduPilot drives, and listens to sticks, as the recorded one does."""
    persona = PROMPT.on(frame)
    world = make_world(
        persona=persona,
        body=partial(body_of, frame),
    )
    world.run(3.0)
    return world


def body_of(frame: Frame, start: object) -> object:
    return kinematic_body(frame, start=start, slip=0.0, seed=None)  # type: ignore[arg-type]


def stands_after(world: World) -> float:
    """Return the seconds after which it stands for good; it does not drive back."""
    began, moved = world.now, world.now
    while world.now < began + 12.0:
        world.run(0.05)
        assert world.truth.forward_speed > -0.05
        if abs(world.truth.forward_speed) > STANDS:
            moved = world.now
    return moved - began


@for_each("held", [FORWARD, BACK])
@for_each(
    "frame, when, within",
    [
        (Frame.SKID, "starting", 1.5),
        (Frame.SKID, "driving", 1.5),
        (Frame.SKID, "cancelled", 1.5),
        (Frame.ACKERMANN, "starting", 2.5),
        (Frame.ACKERMANN, "driving", 2.5),
        (Frame.ACKERMANN, "cancelled", 2.5),
    ],
)
def test_a_stick_held_ends_in_hold(
    make_world: MakeWorld, frame: Frame, when: str, within: float, held: int
) -> None:
    world = with_transmitter(make_world, frame)
    world.client.move(10.0)
    world.run(0.1 if when == "starting" else 4.0)
    if when == "cancelled":
        world.client.command(CANCEL, 1)
    world.rover.autopilot.operator_pulses(held, CENTRE)
    assert stands_after(world) <= within
    assert world.paused() is R.TAKEOVER
    assert world.state(1)[0] is (S.CANCELLED if when == "cancelled" else S.PAUSED)
    said = [text for text in world.client.texts() if "has a stick off centre" in text]
    assert len(said) == 1


def test_the_task_goes_on_when_the_stick_is_centred_and_somebody_says_continue(
    make_world: MakeWorld,
) -> None:
    world = with_transmitter(make_world, Frame.SKID)
    check(world, "TASK_MOVE 4 & wait 4 : ACCEPTED")
    for throttle, seconds in ((FORWARD, 4.0), (CENTRE, 3.0)):
        world.rover.autopilot.operator_pulses(throttle, CENTRE)
        world.run(seconds)
    check(world, "CONTINUE & until 1 COMPLETED within=40 : ACCEPTED")
    assert abs(world.truth.north - 4.0) < 0.1
