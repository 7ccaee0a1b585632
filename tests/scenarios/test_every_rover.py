"""target_system 0 is every rover, for whatever a stock autopilot answers: DroneKit sends it."""

from collections.abc import Iterator

import pytest

from mav_tasks.tasks.lifecycle import TaskReason as R
from rover_sim.personas import ARDUPILOT, PX4, Mode, Persona
from tests.kit.cases import for_each
from tests.kit.client import (
    ACCEPTED,
    ARM,
    DENIED,
    HOLD,
    MOVE,
    PAUSE_CONTINUE,
    REPEATS,
    SET_MODE,
    FakeClient,
)
from tests.kit.fleet import Fleet
from tests.kit.rows import check
from tests.scenarios.conftest import MakeWorld

ALL = (0, 0)
AUTOPILOT_VERSION = 148


@pytest.fixture
def fleet() -> Iterator[Fleet]:
    """Two rovers on links of their own."""
    fleet = Fleet({"one": {"a": (1,)}, "two": {"b": (2,)}})
    fleet.ready()
    yield fleet
    fleet.check()


def answers(client: FakeClient, command: int) -> list[tuple[tuple[int, int], int]]:
    """Return (source, result) of every ack of a command."""
    acks = [(p.source, client.decoded(p)) for p in client.of_id(77)]
    return [(source, ack.result) for source, ack in acks if ack.command == command]


def test_a_disarming_reaches_every_rover_and_each_autopilot_answers(fleet: Fleet) -> None:
    for number in (1, 2):
        fleet.client.arm(target=(number, 1))
    fleet.run(1.5)
    assert all(rover.autopilot.armed for rover in fleet.rovers)
    fleet.other.arm(False, target=ALL)
    fleet.run(0.3)
    assert not any(rover.autopilot.armed for rover in fleet.rovers)
    assert sorted(answers(fleet.other, ARM)) == [((1, 1), ACCEPTED), ((2, 1), ACCEPTED)]


@pytest.mark.parametrize("component", [0, 1])
def test_hold_and_a_pause_reach_every_rover(fleet: Fleet, component: int) -> None:
    for number in (1, 2):
        fleet.client.move(20, speed=1.0, target=(number, 191))
    fleet.run(3)
    fleet.other.mode(HOLD, target=(0, component))
    fleet.run(0.3)
    assert {fleet.queue_paused(n) for n in (1, 2)} == {R.OPERATOR}
    fleet.run(3.5)
    assert {rover.autopilot.mode for rover in fleet.rovers} == {Mode.HOLD}
    assert sorted(answers(fleet.other, SET_MODE)) == [((1, 1), ACCEPTED), ((2, 1), ACCEPTED)]
    fleet.other.proceed(target=(0, component))
    fleet.run(3)
    fleet.other.pause(target=(0, component))
    fleet.run(0.3)
    assert {fleet.queue_paused(n) for n in (1, 2)} == {R.OPERATOR}
    assert len(answers(fleet.other, PAUSE_CONTINUE)) == 4


@for_each("persona, hold", [(ARDUPILOT, "4"), (PX4, "4 3")])
def test_modes_and_capabilities_are_answered(
    make_world: MakeWorld, persona: Persona, hold: str
) -> None:
    check(
        make_world(persona=persona),
        f"""
DO_SET_MODE 1 {hold} to=all : ACCEPTED
REQUEST_MESSAGE 148 to=all : ACCEPTED AUTOPILOT_VERSION@1 / COMMAND_ACK@1
""",
    )


def test_a_task_command_must_name_its_rover_and_is_told_so_once(fleet: Fleet) -> None:
    sent = fleet.client.move(1, target=ALL, repeats=REPEATS)
    fleet.run(1)
    assert sent.answer == (DENIED, R.BAD_PARAMETER)
    assert [source for source, _ in answers(fleet.client, MOVE)] == [(1, 191)]
    assert fleet.tasks() == ()
    assert fleet.client.said("must name one rover")
