import pytest

from mav_tasks.mavlink.address import Address

ROVER = Address(1, 1)


@pytest.mark.parametrize(
    ("target", "reached"),
    [
        (Address(1, 1), True),
        (Address(1, 0), True),
        (Address(0, 1), True),
        (Address(0, 0), True),
        (Address(1, 191), False),
        (Address(2, 1), False),
        (Address(2, 0), False),
        (Address(0, 191), False),
    ],
)
def test_zero_means_everybody(target: Address, reached: bool) -> None:
    assert target.reaches(ROVER) is reached


def test_an_address_reads_as_system_slash_component() -> None:
    assert str(Address(255, 190)) == "255/190"
