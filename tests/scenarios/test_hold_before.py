"""MAVSDK sends a PX4 rover HOLD before each "go to": what was running goes on all the same."""

from tests.kit.cases import anew, for_each
from tests.kit.px4 import PROMPT_PX4
from tests.kit.rows import check
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

GO = "DO_REPOSITION -1 1 0 nan at=5,5 frame=6 to=autopilot"


@anew
def world(make_world: MakeWorld) -> World:
    """A PX4 that a task drives, after another client was heard."""
    world = make_world(persona=PROMPT_PX4)
    check(world, "TASK_MOVE 20 0.5 & faster 0.45 : ACCEPTED")
    return world


def test_a_hold_stands_at_once_and_changes_the_mode_after_a_second(world: World) -> None:
    check(
        world,
        """
HOLD & wait 0.1 : ACCEPTED #1 / task 1: PAUSED OPERATOR / it gets zero.
wait 0.8 : - it gets zero. / mode guided
wait 1.5 : - mode hold / it STANDS
""",
    )


HOLDS = """HOLD & wait 0.03 : ACCEPTED it gets zero. / queue OPERATOR
client:set_mode 1 1 50593792 & wait 0.03 : - it gets zero. / queue OPERATOR
HOLD & wait 0.5 & HOLD & wait 0.03 : ACCEPTED+ACCEPTED it gets zero. / queue OPERATOR"""


@for_each("hold", HOLDS.splitlines())
def test_it_is_undone_by_a_go_to_and_the_mode_is_never_changed(world: World, hold: str) -> None:
    check(
        world,
        f"""
{hold}
{GO} : ACCEPTED #2 / queue NONE / ! hold
wait 3 : - task 1: EXECUTING / it MOVES / ! hold
""",
    )


def test_too_late_undoes_nothing(world: World) -> None:
    check(
        world,
        f"HOLD & wait 1.1 : ACCEPTED\n{GO} : ACCEPTED task 1: PAUSED OPERATOR / queue OPERATOR",
    )


@for_each("order", ["{0} & wait 0.1 & HOLD", "HOLD & wait 0.1 & {0}"])
@for_each("wish, queue", [("TASK_STOP", "STOPPED"), ("PAUSE", "OPERATOR"), ("HOLD", "OPERATOR")])
def test_undoes_only_the_pause_of_its_own_hold(
    world: World, wish: str, queue: str, order: str
) -> None:
    other = world.add_client("other")
    world.run(1.5)
    for row in order.format(f"other> {wish}").split(" & wait 0.1 & "):
        check(world, f"{row} & wait 0.1 : ACCEPTED", other=other)
    check(world, f"{GO} & wait 3 : ACCEPTED queue {queue} / it STANDS / mode hold")
