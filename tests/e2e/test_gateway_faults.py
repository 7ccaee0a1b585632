"""Real gateways with a task under way, with faults at random: nothing is lost, or driven twice."""

import csv
import random
import signal
import time
from contextlib import closing
from pathlib import Path

import pytest

from mav_tasks import Move, NoAnswer, TaskState
from tests.kit.gateways.serving import Serving, Watcher, serving, wait_for_holder, wrong_motions
from tests.kit.postgres import PostgresServer
from tests.kit.processes import wait_until
from tests.kit.volume import tries

S = TaskState
FAULTS = tries(3, long=100)  # 9 s each
SEED = 20261126
METRES = 1.5
SETTLED = 60.0  # s, the most for a task with a fault, on a busy machine

pytestmark = pytest.mark.slow


class Life:
    """Submits one task after another, and disturbs each."""

    def __init__(self, it: Serving, watcher: Watcher, chance: random.Random) -> None:
        self._it, self._watcher, self._chance = it, watcher, chance
        self.kinds: dict[str, int] = {}
        self.taken_after: dict[str, list[float]] = {"killed": [], "silent": []}
        self.acknowledged: list[int] = []

    def one(self) -> None:
        """Submit a task, disturb it, and wait until it is done."""
        task_id = self._submit()
        self._until(task_id, S.EXECUTING, S.COMPLETED)
        kinds = (self.killed, self.suspended, self.cut_off, self.database_restarted, self.ended)
        kind = self._chance.choice(kinds)
        self.kinds[kind.__name__] = self.kinds.get(kind.__name__, 0) + 1
        pause = time.monotonic() + self._chance.uniform(0.0, 1.0)
        wait_until(lambda: time.monotonic() >= pause, within=5)
        kind()
        self._until(task_id, S.COMPLETED)

    def killed(self) -> None:
        """SIGKILL of the gateway that has the rover."""
        name = self._watcher.holder()
        began = time.monotonic()
        self._it.processes[name].end(signal.SIGKILL)
        wait_for_holder(self._watcher, other_than=name)
        self.taken_after["killed"].append(time.monotonic() - began)
        self._it.start(name)

    def ended(self) -> None:
        """SIGTERM of the gateway that has the rover."""
        name = self._watcher.holder()
        self._it.processes[name].end()
        wait_for_holder(self._watcher, other_than=name)
        self._it.start(name)

    def suspended(self) -> None:
        """SIGSTOP until another one has the rover, and a little longer."""
        name = self._watcher.holder()
        began = time.monotonic()
        self._it.processes[name].popen.send_signal(signal.SIGSTOP)
        wait_for_holder(self._watcher, other_than=name)
        self.taken_after["silent"].append(time.monotonic() - began)
        end = time.monotonic() + self._chance.uniform(0.0, 2.0)
        wait_until(lambda: time.monotonic() >= end, within=5)
        self._it.processes[name].popen.send_signal(signal.SIGCONT)

    def cut_off(self) -> None:
        """The net to the database is cut until another one has the rover, or shortly."""
        name = self._watcher.holder()
        with self._it.proxies[name].held():
            if self._chance.random() < 0.5:
                wait_for_holder(self._watcher, other_than=name)
            else:
                end = time.monotonic() + self._chance.uniform(0.0, 1.0)
                wait_until(lambda: time.monotonic() >= end, within=5)
            if self._chance.random() < 0.5:
                self._it.proxies[name].fall_silent()

    def database_restarted(self) -> None:
        """PostgreSQL is ended, or killed, and started again."""
        if self._chance.random() < 0.5:
            self._it.server.stop()
        else:
            self._it.server.kill()
        self._it.server.start()

    def _submit(self) -> int:
        """Submit a task where the rover is; again, with the same nonce, if there is no answer."""
        found: list[int] = []
        nonce = self._chance.randrange(1, 1 << 24)

        def is_submitted() -> bool:
            try:
                with self._it.client(wait_for_holder(self._watcher)) as client:
                    client.resume()
                    found.append(client.submit(Move(METRES), nonce=nonce).id)
            except NoAnswer:
                return False
            return True

        wait_until(is_submitted, within=SETTLED, what=self._it.said)
        self.acknowledged += found
        return found[0]

    def _until(self, task_id: int, *states: TaskState) -> None:
        wait_until(
            lambda: self._it.states().get(task_id) in states,
            within=SETTLED,
            what=lambda: f"{states}: {self._it.states()}\n{self._it.said()}",
        )


def north(truth: Path) -> float:
    """Return how far north the rover truly is, m."""
    text = truth.read_text(encoding="ascii")
    rows = list(csv.DictReader(text[: text.rfind("\n") + 1].splitlines()))
    return float(rows[-1]["north"])


def live(postgres: PostgresServer, folder: Path, *, faults: int, seed: int) -> None:
    """Let gateways live through so many faults, each with a task under way, and judge them."""
    with serving(postgres, folder, "abc") as it, closing(Watcher(it.url)) as watcher:
        life = Life(it, watcher, random.Random(seed))
        for number in range(faults):
            life.one()
            wrong = wrong_motions(list(it.motions), watcher.seen)
            assert wrong == [], f"seed {seed}, fault {number}: {wrong[:3]}\n{it.said()}"
        states = it.states()
        assert len(set(life.acknowledged)) == faults
        assert all(states[each] is S.COMPLETED for each in life.acknowledged)
        driven, wanted = north(folder / "truth.csv"), faults * METRES
        print(f"seed {seed}: {life.kinds}, {len(it.motions)} motions, {driven:.2f} m")
        for how, taken in life.taken_after.items():
            print(f"{how}: {sorted(round(each, 3) for each in taken)} s")
        assert abs(driven - wanted) < 0.05 * faults


@pytest.mark.timeout(14_400)
def test_faults_of_gateways_lose_nothing_and_drive_nothing_twice(
    postgres: PostgresServer, tmp_path: Path
) -> None:
    live(postgres, tmp_path, faults=FAULTS, seed=SEED)
