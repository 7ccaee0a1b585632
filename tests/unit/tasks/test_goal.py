"""Goals in words, as people at a terminal or a ground station read them."""

from mav_tasks.tasks.goal import (
    Drive,
    Face,
    Goal,
    GoTo,
    Jump,
    LocalPlace,
    Move,
    Nothing,
    Plan,
    SetSpeed,
    Wait,
    describe,
    kind_of,
)

PLACE = GoTo(LocalPlace(1.0, -2.0))


def test_goals_in_words() -> None:
    words: tuple[tuple[Goal, str], ...] = (
        (Move(2.0), "move 2 m"),
        (Face(-1.5707963267948966), "face 270 deg"),
        (PLACE, "go to 1.00 m N, -2.00 m E"),
        (Plan((PLACE, Nothing())), "go to 1.00 m N, -2.00 m E"),
        (Plan((SetSpeed(0.4), PLACE, SetSpeed(None), Nothing())), "go to 1.00 m N, -2.00 m E"),
        (Plan((PLACE, Wait(1.0), Nothing())), "plan of 3 items"),
        (Plan((PLACE, Wait(1.0), Nothing()), has_options=True), "plan of 2 items"),
        (Plan((Nothing(),) * 4 + (PLACE,), has_home=True), "plan of 4 items"),
        (Plan((Nothing(),), has_home=True), "plan of 0 items"),
        (Plan((Nothing(), PLACE), has_home=True), "plan of 1 item"),
        (Plan((Wait(1.0), Jump(0, 3))), "plan of 2 items"),
    )
    for goal, said in words:
        assert describe(goal) == said
    kinds = [kind_of(goal) for goal in (Drive(1.0, 0.0, 1.0), GoTo(None), Wait(1.0))]
    assert kinds == ["drive", "return", "wait"]
