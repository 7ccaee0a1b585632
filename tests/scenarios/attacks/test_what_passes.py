"""Attacks S8: what would change more than an operator may.

Named one by one, and not taken from the table that is to stop them.
"""

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as ap
from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Roles, Settings
from mav_tasks.tasks.lifecycle import TaskReason as R
from tests.kit.cases import anew, for_each
from tests.kit.client import DENIED, FakeClient
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

NOT_ALLOWED = (DENIED, R.NOT_ALLOWED)
#: of commands that an operator may not send
BEYOND_OPERATORS = {
    "calibration": 241,
    "sensor offsets": 242,
    "restart": 246,
    "motor test": 209,
    "actuator test": 310,
    "actuators": 311,
    "injected failure": 420,
    "format": 526,
    "another system id": 610,
    "origin": 611,
    "fence item": 5000,
    "CAN bus": 32000,
    "estimator": 42007,
    "bootloader": 42650,
    "position estimate": 43003,
}


def beyond_operators() -> list[Any]:
    """Messages that an operator may not send to a rover."""
    return [
        common.MAVLink_safety_set_allowed_area_message(1, 1, 0, 0, 0, 0, 1, 1, 1),
        common.MAVLink_can_frame_message(1, 1, 0, 8, 1, [1] * 8),
        common.MAVLink_canfd_frame_message(1, 1, 0, 8, 1, [1] * 64),
        common.MAVLink_tunnel_message(1, 1, 0, 4, [0] * 128),
        common.MAVLink_v2_extension_message(0, 1, 1, 7, [0] * 249),
        common.MAVLink_gps_input_message(0, 0, 0, 0, 0, 3, 1, 1, 0, 1, 1, 0, 0, 0, 1, 1, 1, 9),
        common.MAVLink_odometry_message(
            0, 1, 1, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0, 0, 0, 0, [0] * 21, [0] * 21
        ),
        common.MAVLink_vision_position_estimate_message(0, 9, 0, 0, 0, 0, 0),
        common.MAVLink_set_gps_global_origin_message(1, 1, 1, 0),
        common.MAVLink_log_erase_message(1, 1),
        common.MAVLink_wifi_config_ap_message(b"rover", b"secret"),
        ap.MAVLink_secure_command_message(1, 1, 0, 0, 0, 0, [0] * 220),
    ]


def operator(world: World) -> FakeClient:
    """Let somebody take part who may not do what bounds a rover."""
    client = world.add_client("operator", system_id=12)
    world.run(1.2)
    return client


@anew
def with_operator(make_world: MakeWorld) -> World:
    """Return a world in which 12/190 is an operator, and the usual client in charge of safety."""
    roles = Roles(unsigned="safety", addresses={"12/190": "operator"})
    return make_world(settings=Settings(roles=roles))


@for_each("what", BEYOND_OPERATORS)
@for_each("component", [0, 1, 99])
def test_a_command_that_does_more_than_move_is_of_safety_alone(
    with_operator: World, what: str, component: int
) -> None:
    world, client = with_operator, operator(with_operator)
    passed = world.commands_passed_on()
    number = BEYOND_OPERATORS[what]
    sent = client.command(number, 1, target=(1, component))
    world.run(0.6)
    assert sent.answer == NOT_ALLOWED
    assert f"role operator may not send command {number} to a rover; safety may" in client.texts()
    assert number not in passed
    world.client.command(number, 1, target=(1, component))
    world.run(0.2)
    assert number in passed, "who is in charge of safety may"


@for_each("message", beyond_operators())
def test_a_message_that_does_more_than_move_is_of_safety_alone(
    with_operator: World, message: Any
) -> None:
    world, client = with_operator, operator(with_operator)
    passed = world.passed_on((12, 190))
    client.send(message)
    world.run(0.2)
    assert message.get_msgId() not in passed
    passed = world.passed_on((255, 190))
    world.client.send(message)
    world.run(0.2)
    assert message.get_msgId() in passed, "who is in charge of safety may"


def test_a_command_in_an_envelope_is_not_carried_past_the_table(with_operator: World) -> None:
    """COMMAND_LONG_STAMPED and COMMAND_INT_STAMPED: what is in them nobody looks at."""
    world, client = with_operator, operator(with_operator)
    passed = world.passed_on((12, 190))
    for number in (223, 224):
        header = bytes((0xFD, 20, 0, 0, 1, 12, 190)) + number.to_bytes(3, "little")
        client.send_raw(header + b"\1" * 22)
    world.run(0.2)
    assert not passed.intersection((223, 224))
