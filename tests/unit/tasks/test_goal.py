"""Goals in words, as people at a terminal or a ground station read them."""

from mav_tasks.kinds import Drive, Face, GoTo, LocalPlace, Move, Wait
from mav_tasks.tasks.goal import Goal, Jump, Nothing, Plan, SetSpeed

PLACE = GoTo(LocalPlace(1.0, -2.0))


#: each goal below in words
WORDS = """move 2 m
face 270 deg
go to 1.00 m N, -2.00 m E
go to 1.00 m N, -2.00 m E
go to 1.00 m N, -2.00 m E
plan of 3 items
plan of 2 items
plan of 4 items
plan of 0 items
plan of 1 item
plan of 2 items"""


def test_goals_in_words() -> None:
    goals: tuple[Goal, ...] = (
        Move(2.0),
        Face(-1.5707963267948966),
        PLACE,
        Plan((PLACE, Nothing())),
        Plan((SetSpeed(0.4), PLACE, SetSpeed(None), Nothing())),
        Plan((PLACE, Wait(1.0), Nothing())),
        Plan((PLACE, Wait(1.0), Nothing()), has_options=True),
        Plan((Nothing(),) * 4 + (PLACE,), has_home=True),
        Plan((Nothing(),), has_home=True),
        Plan((Nothing(), PLACE), has_home=True),
        Plan((Wait(1.0), Jump(0, 3))),
    )
    assert [goal.words for goal in goals] == WORDS.splitlines()
    kinds = [goal.rule for goal in (Drive(1.0, 0.0, 1.0), GoTo(None), Wait(1.0))]
    assert kinds == ["drive", "return", "wait"]
