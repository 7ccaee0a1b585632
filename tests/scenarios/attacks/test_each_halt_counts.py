"""Each halt counts, also one that looks like the last one again.

A continue that left between two quick halts of its sender was obeyed when the net delivered it
last: the second halt was the first one again. One of a sender that does not count its packets was
acknowledged as a copy of its last one, and was not carried out.
"""

from tests.kit.cases import anew, for_each
from tests.kit.client import (
    ACCEPTED,
    ARM,
    HOLD,
    PAUSE_CONTINUE,
    SET_MODE,
    STOP,
    FakeClient,
    Message,
    command_long,
)
from tests.kit.world import World
from tests.scenarios.attacks.test_left_waiting import stays

HALTS = {
    "pause": command_long(PAUSE_CONTINUE, 0),
    "HOLD": command_long(SET_MODE, 1, HOLD, target=(1, 1)),
    "disarm": command_long(ARM, 0, target=(1, 1)),
    "STOP": command_long(STOP),
}


@anew
def driving(world: World) -> World:
    world.client.move(30)
    world.client.move(5)
    world.until_faster(0.3)
    return world


@for_each("halt", ["pause", "HOLD", "STOP"])
@for_each("apart", [0.02, 0.1, 0.19])
def test_a_continue_from_between_two_quick_halts_is_older_than_the_second(
    driving: World, halt: str, apart: float
) -> None:
    driving.client.send(HALTS[halt])
    driving.run(apart / 2)
    late = driving.client.send_repeated(command_long(PAUSE_CONTINUE, 1))
    driving.run(apart / 2)
    driving.client.send(HALTS[halt])
    driving.run(0.03)
    driving.client.send_raw(late)
    driving.run(3)
    assert stays(driving, 5)


def uncounted(client: FakeClient, message: Message) -> None:
    """Send a message as a script does that gives all its packets the number 0."""
    client.count_anew()
    client.send(message)


@for_each("halt", ["pause", "HOLD", "disarm"])
def test_a_halt_of_one_that_does_not_count_its_packets_is_carried_out_each_time(
    driving: World, halt: str
) -> None:
    script = driving.add_client("script", system_id=245)
    script.heartbeats = False
    uncounted(script, HALTS[halt])
    driving.run(2)
    driving.client.proceed()
    driving.run(3)
    assert driving.truth.forward_speed > 0.2
    before = len(script.acks)
    uncounted(script, HALTS[halt])
    driving.run(1.8)
    assert [ack.result for ack in script.acks[before:]] == [ACCEPTED]
    assert stays(driving, 5)
