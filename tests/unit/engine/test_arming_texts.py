"""What a vehicle says of why it does not arm is kept for a while, and nothing else is."""

import pytest

from mav_tasks.engine.arming_texts import LATELY, ArmingTexts
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavSeverity
from mav_tasks.services.statustext import chunks

ROVER = Address(1, 1)


def told(*texts: str) -> ArmingTexts:
    it = ArmingTexts()
    for number, text in enumerate(texts, 1):
        for message in chunks(MavSeverity.CRITICAL, text, text_id=number):
            it.receive(ROVER, message, now=10.0)
    return it


@pytest.mark.parametrize(
    "text",
    [
        "PreArm: GPS 1: Bad fix",
        "Arm: Hardware safety switch",
        "Preflight Fail: ekf2 missing data",
        "Arming denied! Resolve system health failures first",
    ],
)
def test_what_ardupilot_and_px4_say_is_kept(text: str) -> None:
    assert told(text, "EKF3 IMU0 is using GPS", "Armed by external command").latest(now=11) == text


def test_the_last_one_counts() -> None:
    assert told("PreArm: one", "PreArm: two").latest(now=11) == "PreArm: two"


def test_a_long_one_is_joined() -> None:
    words = "PreArm: " + "Battery 1 low voltage failsafe, and other things " * 2
    assert told(words).latest(now=11) == words.strip()


def test_after_a_while_it_is_not_believed_any_more() -> None:
    assert told("PreArm: one").latest(now=10 + LATELY) == "PreArm: one"
    assert told("PreArm: one").latest(now=10.1 + LATELY) == ""
