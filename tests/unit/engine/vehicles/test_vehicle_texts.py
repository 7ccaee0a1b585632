"""What a vehicle says of why it does not arm, and of its failsafes, is kept for a while."""

import pytest

from mav_tasks.engine.vehicles.vehicle_texts import JUST_NOW, LATELY, VehicleTexts
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavSeverity
from mav_tasks.services.statustext import chunks

ROVER = Address(1, 1)


def told(*texts: str) -> VehicleTexts:
    it = VehicleTexts()
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
    assert (
        told(text, "EKF3 IMU0 is using GPS", "Armed by external command").why_not_ready(now=11)
        == text
    )


def test_the_last_one_counts() -> None:
    assert told("PreArm: one", "PreArm: two").why_not_ready(now=11) == "PreArm: two"


def test_a_long_one_is_joined() -> None:
    words = "PreArm: " + "Battery 1 low voltage failsafe, and other things " * 2
    assert told(words).why_not_ready(now=11) == words.strip()


def test_after_a_while_it_is_not_believed_any_more() -> None:
    assert told("PreArm: one").why_not_ready(now=10 + LATELY) == "PreArm: one"
    assert told("PreArm: one").why_not_ready(now=10.1 + LATELY) == ""


@pytest.mark.parametrize(
    "text",
    [
        "EKF failsafe",
        "GCS Failsafe",
        "Circle fence breached",
        "Battery 1 is low 10.50V used 0 mAh",
        "Failsafe activated",
    ],
)
def test_a_failsafe_is_known_by_its_text_for_a_moment(text: str) -> None:
    assert told(text).failsafe(now=10 + JUST_NOW) == text
    assert told(text).failsafe(now=10.1 + JUST_NOW) == ""


@pytest.mark.parametrize(
    "text", ["GCS Failsafe Cleared", "Failsafe - Continuing Auto Mode", "Throttle disarmed"]
)
def test_what_names_no_failsafe_that_acts_is_none(text: str) -> None:
    assert told(text).failsafe(now=10) == ""
