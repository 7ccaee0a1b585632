"""The wall clock of one gateway's machine is set while the fleet works: nothing is driven twice."""

from pathlib import Path

from mav_tasks.config.settings import Settings
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.cases import for_each
from tests.kit.gateways.engines import moves
from tests.kit.volume import some
from tests.scenarios.test_gateways import KEY, UTC, Fleet

HOUR = 3_600.0
MODIFY, EVERY = 54012, 9
PERIOD = 20

clocks = for_each(
    "whose, error",
    some(
        [
            *(("the holder's", error) for error in (HOUR, -HOUR, 5.0, -5.0, 0.0)),
            *(("the other's", error) for error in (HOUR, -HOUR)),
        ],
        *(1, 3, 4, 5),
    ),
)


def signed(folder: Path) -> Fleet:
    settings = Settings(on_takeover="resume")
    return Fleet(folder, keys=(KEY,), rover_key=KEY, wall_offset=UTC, settings=settings)


@clocks
def test_a_signed_rover_drives_on_and_its_next_gateway_drives_it(
    tmp_path: Path, whose: str, error: float
) -> None:
    fleet = signed(tmp_path)
    task = fleet.submit(5.0)
    fleet.drives(task)
    (fleet.first if whose == "the holder's" else fleet.other).set_clock(error)
    moved: set[str] = set()

    def look(source: str, target: str, data: bytes) -> bool:
        if target == "rover1" and moves(data):
            moved.add(source.partition(":")[0])
        return False

    fleet.watched.loses = look
    north = fleet.truth.north
    fleet.run(3.0)
    assert fleet.truth.north - north > 1.0  # nothing stops for a clock
    assert fleet.database.takeovers == 0
    assert moved == {fleet.first.name}
    fleet.kill(fleet.first.name)
    assert fleet.holder() is fleet.other
    fleet.until(lambda: fleet.task(task).state is S.COMPLETED, within=40)
    assert abs(fleet.truth.north - 5.0) < 0.1
    assert R.RESTARTED not in fleet.shared.part(frozenset({1})).paused.values()
    fleet.check()


@clocks
@for_each("is_taken_over", [False, True])
def test_a_series_runs_each_of_its_times_once(
    tmp_path: Path, whose: str, error: float, *, is_taken_over: bool
) -> None:
    fleet = Fleet(tmp_path, wall_offset=UTC, settings=Settings(on_takeover="resume"))
    task = fleet.submit(0.2)
    assert fleet.near.command(MODIFY, task, EVERY, PERIOD) is not None
    fleet.until(lambda: fleet.task(task).state is S.COMPLETED, within=15)
    began = fleet.now
    (fleet.first if whose == "the holder's" else fleet.other).set_clock(error)
    fleet.run(1.0)
    if is_taken_over:
        fleet.kill(fleet.first.name)
        assert fleet.holder() is fleet.other
    fleet.run(3 * PERIOD)
    stored = fleet.shared.tasks()
    runs = [each for each in stored if each.terms.series == task and each.id != task]
    done = sum(each.state is S.COMPLETED for each in runs)
    periods = (fleet.now - began) / PERIOD
    if is_taken_over and error:
        # a period counts by the clock that stored it: the next one may come at once, or much later
        assert done <= periods + 1
    else:
        assert periods - 1 <= done <= periods + 1
    assert [each.state for each in runs if each.state is not S.COMPLETED] == [S.SCHEDULED]
    assert abs(fleet.truth.north - 0.2 * (1 + done)) < 0.1
    fleet.check()
