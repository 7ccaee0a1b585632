"""The server's own requests are repeated until they are answered, but not once they are shown."""

from collections.abc import Callable
from struct import unpack_from

from rover_sim.personas import ARDUPILOT, PX4, Mode
from tests.kit.cases import for_each
from tests.kit.world import World

COMMAND_LONG, COMMAND_ACK = 76, 77
ARM, SET_MODE = 400, 176
OFFBOARD = 6.0  # custom_mode of a PX4, as DO_SET_MODE has it


def is_answer(source: str, datagram: bytes, command: int) -> bool:
    """Whether the rover answers this command."""
    if source != "rover1" or datagram[7] != COMMAND_ACK:
        return False
    return bool(unpack_from("<H", datagram + bytes(2), 10)[0] == command)


@for_each("phase", [0.45, 0.6, 0.75, 0.9])
@for_each("after", [0.05, 0.15, 0.25])
def test_who_disarms_a_rover_while_an_arming_is_unanswered_keeps_it_disarmed(
    make_world: Callable[..., World], phase: float, after: float
) -> None:
    world = make_world(persona=ARDUPILOT)
    world.run(phase)
    world.watched.loses = lambda source, _, datagram: is_answer(source, datagram, ARM)
    world.client.move(10, speed=0.5)
    world.until(lambda: world.control() == "CONTROL", within=10)
    world.run(after)
    world.operator_arm(False)
    world.run(6)
    assert not world.is_armed


@for_each("phase", [0.0, 0.2, 0.4])
@for_each("after", [0.06, 0.1, 0.2, 0.3])
def test_who_sets_hold_while_a_mode_is_unanswered_keeps_it(
    make_world: Callable[..., World], phase: float, after: float
) -> None:
    world = make_world(persona=PX4)
    world.run(phase)
    asked: list[float] = []

    def loses(source: str, target: str, datagram: bytes) -> bool:
        """Lose the answers to OFFBOARD."""
        if target == "rover1" and datagram[7] == COMMAND_LONG:
            *_, mode, command = unpack_from("<ff20xH", datagram + bytes(40), 10)
            asked.extend([mode] if command == SET_MODE else [])
        return is_answer(source, datagram, SET_MODE) and asked[-1:] == [OFFBOARD]

    world.watched.loses = loses
    world.client.move(10, speed=0.5)
    world.until(lambda: world.control() == "CONTROL", within=15)
    world.run(after)
    world.operator_mode(Mode.HOLD)
    world.run(6)
    assert world.mode() is Mode.HOLD
