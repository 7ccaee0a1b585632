"""Whole worlds live by chance: every rule is judged at each step, and each is able to fail."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from mav_tasks.links.memory import Conditions
from mav_tasks.mavlink.address import Address
from mav_tasks.tasks.events import Event, SubmissionRefused, TaskChanged, TaskSubmitted
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.task import TaskId
from rover_sim.body import BodyState
from tests.kit.client import ACCEPTED, TEMPORARILY_REJECTED, setpoint
from tests.kit.soak.ledger import Ledger
from tests.kit.soak.life import Life, live
from tests.kit.soak.world import SoakWorld, Violation
from tests.kit.volume import tries
from tests.kit.world import PROMPT, World

ROOT = Path(__file__).resolve().parents[2]
SOAK = ROOT / "tools" / "soak.py"
VIRTUAL_MINUTE = 60.0


@pytest.mark.volume
@pytest.mark.slow
@pytest.mark.timeout(240)  # it takes some three seconds, of a processor of its own
@pytest.mark.parametrize("seed", range(tries(5, long=100)))
def test_a_life_of_a_minute_breaks_no_rule(seed: int) -> None:
    print("seed", seed)
    figures = live(seed, seconds=VIRTUAL_MINUTE)
    assert figures.virtual > VIRTUAL_MINUTE
    assert figures.faults.total() + figures.deeds.total() > 5
    assert not figures.broken  # what somebody has halted stands until somebody says go


@pytest.mark.volume
@pytest.mark.slow
@pytest.mark.timeout(180)
def test_the_same_seed_is_the_same_life_whatever_the_hashes() -> None:
    digests: list[int] = []

    def note(life: Life) -> None:
        digests.append(life.world.digest)

    live(4, seconds=9, then=note)
    other = subprocess.run(
        [sys.executable, str(SOAK), "--seed", "4", "--minutes", "0.15"],
        env={**os.environ, "PYTHONHASHSEED": "12345"},
        capture_output=True,
        text=True,
        check=True,
        timeout=150,
    )
    assert f"digest {digests[0]:08x}" in other.stdout.splitlines()


@pytest.mark.volume
@pytest.mark.slow
@pytest.mark.timeout(180)
def test_a_life_that_fails_says_its_seed_and_how_to_have_it_again(tmp_path: Path) -> None:
    """The tool is given a life in which something is broken on purpose."""
    broken = tmp_path / "broken.py"
    broken.write_text(
        f"import runpy, sys\nsys.path[:0] = [{str(ROOT)!r}, {str(ROOT / 'sim')!r}]\n"
        "from tests.kit.soak import bounds\nbounds.MOST = 3\nbounds.LARGER.clear()\n"
        "sys.argv = ['soak.py', '--seed', '11', '--minutes', '0.1']\n"
        f"runpy.run_path({str(SOAK)!r}, run_name='__main__')\n",
        "utf-8",
    )
    ended = subprocess.run(
        [sys.executable, str(broken)], capture_output=True, text=True, check=False, timeout=150
    )
    assert ended.returncode == 1
    assert ended.stdout.splitlines()[0] == "seed 11"
    assert "seed 11 FAILED; again: tools/soak.py --seed 11 --minutes 0.1" in ended.stdout
    assert "Violation: seed 11," in ended.stderr


# each rule is able to fail


@pytest.fixture
def world(tmp_path: Path) -> Iterator[SoakWorld]:
    world = SoakWorld(
        tmp_path, seed=0, rovers=1, persona=PROMPT, conditions=Conditions(delay=0.002)
    )
    world.ready()
    yield world
    world.disk.close()


def runs_away(truth: BodyState, *, now: float) -> tuple[float, float]:
    return 0.3, 0.0


def drive(world: World) -> None:
    world.client.move(3, nonce=7)
    world.until_state(1, S.EXECUTING)
    world.run(1)


def test_a_task_that_the_server_forgets_is_missed(world: SoakWorld) -> None:
    drive(world)
    world.client.move(1, nonce=8)
    world.run(0.1)
    del world.server.engine._registry._tasks[2]  # type: ignore[arg-type]
    with pytest.raises(Violation, match="task 2 was accepted, and is lost"):
        world.run(1.1)


def test_a_task_that_a_restart_loses_is_missed(
    world: SoakWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    drive(world)
    monkeypatch.setattr(world.disk_store, "committed", list)
    with pytest.raises(Violation, match="task 1 was accepted, and is lost by the restart"):
        world.restart(away=1.0)


def test_a_restart_that_loses_nothing_breaks_no_rule(world: SoakWorld) -> None:
    drive(world)
    world.restart(away=5.0)
    world.run(3)
    assert world.state(1) == (S.HELD, R.OUTCOME_UNKNOWN)


def test_one_submission_that_becomes_two_tasks_is_noticed(
    world: SoakWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    drive(world)
    (event,) = (e for e in world.disk_store.events if isinstance(e, TaskSubmitted))
    twin = replace(event, task=replace(event.task, id=2))  # type: ignore[arg-type]
    world.disk_store.events.append(twin)
    with pytest.raises(Violation, match="one submission of nonce 7 is task 1 and 2"):
        world.run(0.1)


def called_off(world: SoakWorld) -> list[Event]:
    """Return the journal of a submission that was withdrawn and then not stored in time."""
    world.disk_store.delay = 1.0
    first = world.client.move(1, nonce=7)
    world.run(0.1)
    world.client.command(54010, 1)
    world.run(0.5)
    assert first.result == TEMPORARILY_REJECTED
    assert world.state(1)[0] is S.CANCELLED
    return world.disk_store.events


def test_what_was_called_off_before_it_could_be_stored_may_be_asked_for_again(
    world: SoakWorld,
) -> None:
    called_off(world)
    world.disk_store.delay = 0.0
    world.run(2)
    again = world.client.move(1, nonce=7)
    world.run(0.5)
    assert again.answer == (ACCEPTED, 2)


@pytest.mark.parametrize("but", ["it was accepted", "it began", "it waits", "another was refused"])
def test_what_was_refused_is_no_excuse_for_another_task_twice(world: SoakWorld, but: str) -> None:
    events = called_off(world)
    submitted = next(e for e in events if isinstance(e, TaskSubmitted))
    cancelled = next(e for e in events if isinstance(e, TaskChanged))
    refused = next(e for e in events if isinstance(e, SubmissionRefused))
    ledger = Ledger()
    assert list(ledger.follow([submitted])) == []
    if but == "it was accepted":
        ledger.accepted.add(1)
    elif but == "it began":
        began = replace(cancelled, old=S.QUEUED, new=S.STARTING)
        assert list(ledger.follow([began])) == []
        ledger.states[1] = S.QUEUED
    elif but == "another was refused":
        refused = replace(refused, command=54001)
    if but != "it waits":
        assert list(ledger.follow([cancelled])) == []
    twin = replace(submitted, task=replace(submitted.task, id=TaskId(2)))
    assert list(ledger.follow([refused, twin])) == ["one submission of nonce 7 is task 1 and 2"]


class Never(set[int]):
    """Nothing is in it, whatever was put there."""

    def __contains__(self, _what: object) -> bool:
        return False


@pytest.mark.patches_core
@pytest.mark.parametrize(("delay", "is_early"), [(0.0, False), (0.2, True), (9.0, False)])
def test_an_end_that_was_told_and_that_a_restart_loses_was_told_too_early(
    world: SoakWorld, monkeypatch: pytest.MonkeyPatch, delay: float, *, is_early: bool
) -> None:
    told = "was told KILLED of task 1, and the disk was not"
    drive(world)
    monkeypatch.setattr(world.server.pump.engine._publisher, "_ended", Never())
    world.disk_store.delay = delay
    world.client.stop()
    world.run(0.1 if is_early else 0.6)
    with pytest.raises(Violation, match=told) if is_early else nullcontext():
        world.restart(away=1.0)
    assert world.ledger.taken_back == (delay > 0.0)


def test_an_end_that_is_none_is_noticed(world: SoakWorld) -> None:
    drive(world)
    world.client.stop()
    world.until_state(1, S.KILLED)
    killed = next(e for e in world.disk_store.events if isinstance(e, TaskChanged) and e.new == 12)
    again = replace(killed, old=S.KILLED, new=S.STARTING)
    world.disk_store.events.append(again)
    with pytest.raises(Violation, match="task 1 goes from KILLED to STARTING"):
        world.run(0.1)


def test_what_a_client_was_told_is_held_against_what_it_is_told_later() -> None:
    ledger = Ledger()
    status: Any = type("Status", (), {"task_id": 1, "version": 3, "state": int(S.COMPLETED)})
    assert list(ledger.tell(status, "c")) == []
    status.version, status.state = 2, int(S.EXECUTING)
    assert list(ledger.tell(status, "c")) == []  # late
    status.version = 4
    assert list(ledger.tell(status, "c")) == ["c was told COMPLETED, then EXECUTING of task 1"]


def test_a_rover_that_moves_by_itself_is_seen(world: SoakWorld) -> None:
    world.rover.autopilot.step = runs_away  # type: ignore[method-assign]
    with pytest.raises(Violation, match=r"rover 1 moves, 0\.\d+, and nobody drives it"):
        world.run(1)


def test_a_rover_that_does_not_stop_is_seen_within_the_bound(world: SoakWorld) -> None:
    drive(world)
    at = world.now
    world.rover.autopilot.step = runs_away  # type: ignore[method-assign]
    world.client.stop()
    with pytest.raises(Violation, match=r"rover 1 moves, 0\.\d+, 1\.5\d s after STOP"):
        world.run(3)
    assert world.now - at < 1.7


def test_a_setpoint_that_must_not_be_is_seen_at_once(world: SoakWorld) -> None:
    world.run(0.5)
    at = world.now
    from pymavlink.dialects.v20 import common

    moving = setpoint(0.5).pack(common.MAVLink(None, 250, 191))
    world.net.send("server:vehicles", "rover1", moving)
    with pytest.raises(Violation, match="moving setpoint to a rover not seen armed"):
        world.run(1)
    assert world.now - at < 0.05


def test_a_setpoint_that_is_no_number_is_seen_at_once(world: SoakWorld) -> None:
    from pymavlink.dialects.v20 import common

    moving = setpoint(float("nan")).pack(common.MAVLink(None, 250, 191))
    world.net.send("server:vehicles", "rover1", moving)
    with pytest.raises(Violation, match="setpoint not finite"):
        world.run(1)


def test_two_sources_of_motion_are_seen(world: SoakWorld) -> None:
    from pymavlink.dialects.v20 import common

    drive(world)
    moving = setpoint(0.5).pack(common.MAVLink(None, 9, 1))
    world.net.send("somebody", "rover1", moving)
    with pytest.raises(Violation, match="two sources of setpoints"):
        world.run(1)


@pytest.mark.patches_core
def test_a_server_that_remembers_too_much_is_found(world: SoakWorld) -> None:
    kept = {Address(1, 1): list(range(2_000))}
    world.server.engine._vehicles.leak = kept  # type: ignore[attr-defined]
    with pytest.raises(Violation, match=r"Engine\..*\.leak\[\] holds 2000"):
        world.judge_all()
