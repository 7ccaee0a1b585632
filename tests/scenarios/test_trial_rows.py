"""The table of ``mav-tasks trial`` on simulated rovers as they are by default, in virtual time.

Each row has a rover of its own that has just been switched on.
"""

import pytest

from mav_tasks.basics.errors import UsageError
from rover_sim.frames import Frame
from rover_sim.trial.rows import Row, Verdict, run_rows, table
from rover_sim.trial.session import Limits, Session
from tests.kit.trial_ground import MAKES, Make, TrialGround

#: by default, and what each kind of rover can do
LIMITS = {
    "ardupilot skid": Limits(end=0.05, turn=1.0, stick=1.5, remainder=0.05),
    "ardupilot ackermann": Limits(end=0.10, stick=2.5, remainder=0.10),
    "px4 differential": Limits(end=0.05, turn=2.0, remainder=0.05),
    "px4 ackermann": Limits(end=0.5, remainder=0.5),
}
NAMES = ("tasks", "stop", "restart", "kill", "reboot", "boot")
CASES = [("ardupilot skid", name) for name in (*NAMES, "stick")] + [
    *[("ardupilot ackermann", name) for name in ("stop", "stick")],
    *[("px4 differential", name) for name in ("stop", "restart", "kill")],
    *[("px4 ackermann", name) for name in ("kill", "reboot")],
]


def trial(make: Make, row: str, limits: Limits) -> list[Row]:
    """Run one row on a new rover."""
    ground = TrialGround(make)
    rows: list[Row] = []

    async def run() -> None:
        session = Session(ground, limits, print)
        try:
            await run_rows(session, (row,), done=rows.append)
        finally:
            await session.end()

    ground.run(run())
    print(*table(rows), sep="\n")  # shown where it fails
    return rows


@pytest.mark.timeout(300)
@pytest.mark.parametrize(("make", "row"), CASES)
def test_a_rover_as_it_is_holds_the_table(make: str, row: str) -> None:
    rows = trial(MAKES[make], row, LIMITS[make])
    assert rows
    assert {each.verdict for each in rows} == {Verdict.PASS}


def test_a_rover_whose_failsafe_is_not_set_ends_the_trial_at_once() -> None:
    with pytest.raises(UsageError, match="mav-tasks probe --set-failsafe"):
        trial(Make("px4", Frame.DIFFERENTIAL), "restart", Limits())
