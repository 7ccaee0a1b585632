"""Real gateways on a real PostgreSQL, with faults at random: never two that move one vehicle."""

import random
import time
from pathlib import Path

import pytest

from tests.kit.gateways.faults import Faults
from tests.kit.gateways.real import Motion, fleet, overlaps
from tests.kit.postgres import PostgresServer
from tests.kit.volume import tries

pytestmark = pytest.mark.slow

FAULTS = tries(6, long=1000)  # 2 s each
SEED = 20261125
VEHICLES = range(1, 7)


def quantiles(figures: list[float]) -> str:
    """Return the median, the 99th percentile and the greatest of some seconds."""
    if not figures:
        return "none"
    found = sorted(figures)
    p50, p99 = (found[int(len(found) * share)] for share in (0.5, 0.99))
    return f"{len(found)}: p50 {p50:.3f}, p99 {p99:.3f}, max {found[-1]:.3f} s"


def live(postgres: PostgresServer, folder: Path, *, faults: int, seed: int) -> None:
    """Let a fleet live through so many faults, and judge what it moved."""
    began = time.monotonic()
    with fleet(postgres, folder, "abc", VEHICLES) as it:
        all_faults = Faults(it, random.Random(seed))
        for number in range(faults):
            kind = all_faults.one()
            found = overlaps(it.read())
            assert found == [], f"seed {seed}, fault {number}, {kind}: {found}\n{it.said()}"
        motions = it.read()
    takeovers = len({(each.epoch, each.vehicle) for each in motions}) - len(VEHICLES)
    print(
        f"seed {seed}: {faults} faults {all_faults.counts}, {takeovers} takeovers of a vehicle,"
        f" {len(motions)} motions, {time.monotonic() - began:.0f} s"
    )
    print(f"without a mover after SIGKILL, of vehicles: {quantiles(all_faults.after_kill)}")
    print(f"after a silent death: {quantiles(all_faults.after_silence)}")


@pytest.mark.timeout(14_400)
def test_under_faults_no_two_gateways_move_one_vehicle(
    postgres: PostgresServer, tmp_path: Path
) -> None:
    live(postgres, tmp_path, faults=FAULTS, seed=SEED)


def test_two_that_move_one_vehicle_in_turns_are_found() -> None:
    """So that nothing found means something."""
    one, other = (Motion(1.0, 1.1, 1, "a", 1, 7), Motion(2.0, 2.1, 2, "b", 2, 7))
    late = Motion(3.0, 3.1, 1, "a", 1, 7)
    assert overlaps([one, other]) == []
    assert overlaps([one, other, late]) != []
    suspended = Motion(1.2, 3.1, 1, "a", 1, 7)  # between its question and its line
    assert overlaps([one, other, suspended]) == []
