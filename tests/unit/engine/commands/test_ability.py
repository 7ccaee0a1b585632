import pytest

from mav_tasks.engine.commands.ability import Ability, as_driven
from mav_tasks.errors import Rejection
from mav_tasks.settings import Turning
from mav_tasks.tasks.goal import Drive, Face, GoTo, Head, LocalPlace, Move, Rotate, SingleGoal

PLACE = LocalPlace(3.0, 4.0)
SKID = Ability(honours_yaw_rate=True, turning=Turning.ON_SPOT)
CAR = Ability(honours_yaw_rate=True, turning=Turning.STEERED, rover="rover 1")
PX4_CAR = Ability(honours_yaw_rate=False, turning=Turning.STEERED, rover="rover 1")


@pytest.mark.parametrize("ability", [CAR, PX4_CAR])
@pytest.mark.parametrize(
    "goal", [Rotate(1.0), Face(1.0), Drive(0.0, 0.5, 1.0), Head(1.0, 0.0, 1.0)]
)
def test_a_car_is_not_turned_on_the_spot(ability: Ability, goal: SingleGoal) -> None:
    with pytest.raises(Rejection, match="rover 1 steers like a car and cannot turn on the spot"):
        as_driven(goal, ability)


@pytest.mark.parametrize(
    "goal", [Move(-1.0), Drive(-0.5, 0.0, 1.0), Drive(0.5, 0.2, 1.0), Head(1.0, -0.5, 1.0)]
)
def test_a_car_reverses_and_bends_if_it_honours_a_yaw_rate(goal: SingleGoal) -> None:
    assert as_driven(goal, CAR) is goal
    with pytest.raises(Rejection, match=r"rover 1 (cannot reverse|is steered by course)"):
        as_driven(goal, PX4_CAR)


@pytest.mark.parametrize(("ability", "yaw"), [(SKID, 1.0), (CAR, None), (PX4_CAR, None)])
def test_a_car_ends_a_way_with_the_heading_that_it_has(ability: Ability, yaw: float | None) -> None:
    assert as_driven(GoTo(PLACE, speed=0.4, yaw=1.0), ability) == GoTo(PLACE, speed=0.4, yaw=yaw)


@pytest.mark.parametrize("goal", [Rotate(1.0), Face(1.0), Move(-1.0), GoTo(PLACE, yaw=1.0)])
def test_a_rover_that_turns_on_the_spot_drives_everything(goal: SingleGoal) -> None:
    assert as_driven(goal, SKID) is goal
