"""MAVSDK sends a PX4 rover HOLD before each "go to": what was running goes on all the same."""

from math import nan

from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Mode
from tests.kit.cases import anew, for_each
from tests.kit.client import ACCEPTED, set_mode
from tests.kit.px4 import HOLD, PROMPT_PX4, REPOSITION, ask_mode, go_to
from tests.kit.world import World, at
from tests.scenarios.conftest import MakeWorld


@anew
def world(make_world: MakeWorld) -> World:
    return make_world(persona=PROMPT_PX4)


def driving(world: World) -> World:
    """Have a task drive."""
    world.client.move(20, speed=0.5)
    world.until_faster(0.45)
    return world


class TestAHoldBeforeAGoTo:
    def test_stands_at_once_and_changes_the_mode_after_a_second(self, world: World) -> None:
        asked_at = driving(world).now
        sent = ask_mode(world.client, HOLD)
        world.run(0.1)
        assert sent.answer == (ACCEPTED, 1)
        assert world.state(1) == (S.PAUSED, R.OPERATOR)
        world.run(0.8)
        assert set(world.observer.sent_since(asked_at)) == {"zero"}
        modes = [world.mode()]
        world.run(1.5)
        modes.append(world.mode())
        assert modes == [Mode.GUIDED, Mode.HOLD]
        assert world.stands()

    @for_each("ask", ["DO_SET_MODE", "SET_MODE", "twice"])
    def test_is_undone_by_it_and_the_mode_is_never_changed(self, world: World, ask: str) -> None:
        asked_at = driving(world).now
        if ask == "SET_MODE":
            world.client.send(set_mode(HOLD))
        else:
            ask_mode(world.client, HOLD)
        if ask == "twice":
            world.run(0.5)
            ask_mode(world.client, HOLD)
        world.run(0.03)
        assert "zero" in world.observer.sent_since(asked_at)
        assert world.paused() is R.OPERATOR
        assert go_to(world, 5.0, 5.0) == 2
        assert world.paused() is R.NONE
        world.run(3)
        assert world.state(1)[0] is S.EXECUTING
        assert world.truth.forward_speed > 0.4
        assert "HOLD" not in world.observer.sent_since(asked_at)

    def test_too_late_undoes_nothing(self, world: World) -> None:
        driving(world)
        ask_mode(world.client, HOLD)
        world.run(1.1)
        go_to(world, 5.0, 5.0)
        assert world.state(1) == (S.PAUSED, R.OPERATOR)
        assert world.paused() is R.OPERATOR

    @for_each("order", [(0, 1), (1, 0)])
    @for_each("wish", ["stop", "pause", "hold of another"])
    def test_undoes_only_the_pause_of_its_own_hold(
        self, world: World, wish: str, order: tuple[int, int]
    ) -> None:
        other = world.add_client("other")
        world.run(1.5)
        driving(world)
        wishes = {
            "stop": other.stop,
            "pause": other.pause,
            "hold of another": lambda: ask_mode(other, HOLD),
        }
        both_wishes = (wishes[wish], lambda: ask_mode(world.client, HOLD))
        for number in order:
            both_wishes[number]()
            world.run(0.1)
        sent = world.client.command_int(
            REPOSITION, -1, 1, 0, nan, **at(5, 5), frame=6, target=(1, 1)
        )
        world.run(3)
        assert sent.ack is not None
        assert world.paused() is (R.STOPPED if wish == "stop" else R.OPERATOR)
        assert world.stands()
        assert world.mode() is Mode.HOLD
