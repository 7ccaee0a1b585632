import pytest

from mav_tasks.mavlink.messages import AutopilotVersion
from mav_tasks.services.identity import VehicleIdentity, identity_of


def version(
    number: int, custom: bytes, *, uid: int = 0, uid2: bytes = bytes(18)
) -> AutopilotVersion:
    words = list(custom)
    return AutopilotVersion(0, number, 0, 0, 0, words, [0] * 8, [0] * 8, 0, 0, uid, list(uid2))


@pytest.mark.parametrize(
    ("message", "uid", "firmware"),
    [
        (version(0x040603FF, b"3fc7011a", uid=0x1F), "1f", "4.6.3 3fc7011a"),
        (version(0x010F04C0, b"\x99\xc4\x04\x07\0\0\0\0"), "", "1.15.4-rc 99c4040700000000"),
        (version(0x04070080, bytes(8), uid=1, uid2=b"\x01" * 18), "01" * 18, "4.7.0-beta"),
        (version(0x04070000, b"abc\0\0\0\0\0"), "", "4.7.0-dev abc"),
        (version(0, b"3fc7011a"), "", ""),
    ],
)
def test_a_rover_is_known_by_its_uid_and_its_firmware(
    message: AutopilotVersion, uid: str, firmware: str
) -> None:
    assert identity_of(message) == VehicleIdentity(uid, firmware)
