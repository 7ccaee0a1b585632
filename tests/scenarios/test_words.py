"""What operators are told: once, with the button to press, in the words that people use."""

from math import nan

from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.cases import for_each
from tests.kit.client import AUTO, RTL, FakeClient
from tests.kit.rows import check
from tests.kit.world import World, at

REPOSITION = 192
CANCELLED, TEMPORARILY_REJECTED = 6, 1  # MAV_RESULT
WARNING = 4  # MAV_SEVERITY
FIRST_PIECE = 50  # characters that a client shows that does not join pieces
QGC_RETRY = 1.32  # s between its three requests for a mode


def station(world: World) -> FakeClient:
    """A ground station, which reads no TASK_STATUS."""
    other = world.add_client("station", reads_dialect=False)
    world.run(1.2)
    return other


def said(client: FakeClient) -> dict[str, int]:
    """Return the first pieces of the texts, and their severity."""
    return {m.text: m.severity for m in client.of_type("STATUSTEXT") if not m.chunk_seq}


@for_each(
    "how, why",
    [("pause", ", or set Hold and click again (queue paused)"), ("stop", " (STOP in force)")],
)
def test_a_go_to_that_waits_for_a_button_is_a_warning_that_names_it(
    world: World, how: str, why: str
) -> None:
    screen = station(world)
    world.client.move(1)
    world.until_state(1, S.EXECUTING)
    world.client.pause() if how == "pause" else world.client.stop()
    world.run(3)
    screen.received.clear()
    screen.command_int(REPOSITION, -1, 1, 0, nan, **at(3, 0), frame=0, target=(1, 1))
    world.run(0.3)
    (text,) = (t for t in said(screen) if t.startswith("Task 2"))
    assert text.startswith(f"Task 2 waits, press Continue{why}"[:FIRST_PIECE])
    assert said(screen)[text] == WARNING


def test_who_called_a_task_off_is_said(world: World) -> None:
    check(
        world,
        """
TASK_MOVE 5 & until 1 EXECUTING : ACCEPTED
TASK_MOVE 4 0 0 2 : ACCEPTED
TASK_CANCEL 2 : ACCEPTED Task 2 cancelled by a ground station
TASK_CANCEL 1 & wait 4 : ACCEPTED Task 1 cancelled
""",
    )


@for_each("mode", [RTL, AUTO])
def test_a_mode_that_is_refused_is_one_box_and_one_text_however_often_it_is_asked_for(
    world: World, mode: int
) -> None:
    """CANCELLED is shown by no version; what it calls refused, each time."""
    screen = station(world)
    world.client.move(1)
    world.until_state(1, S.EXECUTING)
    world.client.stop()
    world.run(3)
    screen.received.clear()
    results = []
    for _ in range(3):
        sent = screen.mode(mode)
        world.run(QGC_RETRY)
        results.append(sent.result)
    assert results == [TEMPORARILY_REJECTED, CANCELLED, CANCELLED]
    assert [t for t in screen.texts() if "STOP" in t] == ["STOP is in force: press Continue first"]
    world.run(2)
    again = screen.mode(mode)
    world.run(0.2)
    assert again.result == TEMPORARILY_REJECTED, "later, it is another wish"


class TestSummary:
    """A station that is new, or back, is told why nothing moves, once it knows the rover."""

    def test_of_a_pause(self, world: World) -> None:
        check(world, "TASK_MOVE 5 & until 1 EXECUTING : ACCEPTED\nTASK_MOVE 2 0 0 2 : ACCEPTED")
        check(world, "PAUSE & wait 3 : ACCEPTED")
        assert said(station(world)) == {
            "Task 1 paused, press Continue (queue paused); 1 ta": WARNING
        }

    def test_of_a_stop(self, world: World) -> None:
        check(world, "TASK_MOVE 5 & TASK_STOP & wait 2 : ACCEPTED+ACCEPTED")
        screen = station(world)
        assert said(screen) == {"STOP in force, press Continue; 1 task waits": WARNING}
        screen.received.clear()
        world.run(20)
        assert screen.texts() == [], "it is told once"

    def test_of_a_station_that_was_silent_and_is_back(self, world: World) -> None:
        screen = station(world)
        world.client.move(5)
        world.client.stop()
        world.run(2)
        screen.heartbeats = False
        world.run(5)
        screen.received.clear()
        screen.heartbeats = True
        world.run(2.5)
        assert "STOP in force, press Continue; 1 task waits" in screen.texts()
