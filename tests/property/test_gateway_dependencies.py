"""Chains of tasks over rovers of several gateways, with faults by seed and lost notifications.

No task starts before the one that it waits for is stored as completed; none that may start is
forgotten; and a failure reaches all that follow it.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from mav_tasks.tasks.events import TaskWaits
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.task import Task
from tests.kit.client import ACCEPTED, HOLD
from tests.kit.gateways.order import early_starts
from tests.kit.volume import tries
from tests.property.test_gateways import AGAIN, RELEASE, Life, well

MOVE, CANCEL = 54000, 54010
FROM_HERE = 0  # all of a held task again: the rover may have rolled off its path
METRES = 0.5
LATER = 600.0  # s
CHAIN = 5
SEEDS = tries(4, long=1000)  # 1.8 s each
AT_ONCE = 4


class Chains(Life):
    """Two rovers, whose tasks run after each other's."""

    def __init__(self, folder: Path, seed: int) -> None:
        super().__init__(folder, seed, on_takeover="hold", rovers=2)
        self.world.lost_notices = self.chance.choice([0.0, 0.5, 1.0])

    def say(self, command: int, *params: float, rover: int) -> int:
        """Send a command at any gateway until it is accepted; return the id in its answer."""
        tries = []
        for _ in range(60):
            those = [each for each in self.world.gateways.values() if well(each)]
            if those:
                self.client.server = f"{self.chance.choice(those).name}:clients"
                tries.append(self.client.command(command, *params, target=(rover, 191)))
            self.world.run(1.0)
            for sent in tries:  # all mean the same
                if sent.result == ACCEPTED:
                    return sent.task_id
        raise AssertionError(f"not accepted: {command} {params}: {self.world.describe()}")

    def move(self, rover: int, *, after: int = 0, delay: float = 0.0) -> int:
        nonce = self.chance.randrange(1, 1 << 24)
        return self.say(MOVE, METRES, 0, 0, nonce, after, delay, 5, rover=rover)

    def disturb(self) -> None:
        if self.chance.random() < 0.4:  # a rover drives out of a gateway's reach, and back
            name, rover = self.chance.choice(list(self.world.gateways)), self.chance.choice((1, 2))
            self.world.cut(name, rover)
            self._later(self.chance.uniform(6.0, 14.0), lambda: self.world.mend(name, rover))
        else:
            super().disturb()

    def live(self) -> None:
        """Submit a chain, with faults, and one whose first task is cancelled."""
        self.world.run(5.0)
        ahead, rover = 0, 1
        for _ in range(CHAIN):
            ahead = self.move(rover, after=ahead)
            self.done.append(ahead)
            rover = self.chance.choice((rover, 3 - rover, 3 - rover))
            self.world.run(self.chance.uniform(0.0, 2.0))
            for _ in range(self.chance.randrange(3)):
                self.disturb()
        first = self.move(1, delay=LATER)
        second = self.move(2, after=first)
        third = self.move(self.chance.choice((1, 2)), after=second)
        self.disturb()
        while self._tasks()[first].state is not S.CANCELLED:  # a gateway that fails may lose that
            self.say(CANCEL, first, rover=1)
            self.world.run(AGAIN)
        self.disturb()
        self._let_all_end()
        failed = (S.FAILED, R.DEPENDENCY_FAILED)
        states = {each: (task.state, task.reason) for each, task in self._tasks().items()}
        assert (states[second], states[third]) == (failed, failed), states

    def _tasks(self) -> dict[int, Task]:
        return {int(task.id): task for task in self.world.shared.tasks()}

    def _let_all_end(self) -> None:
        for _ in range(150):
            tasks = self._tasks()
            waiting = [task for task in tasks.values() if task.state < S.COMPLETED]
            if not waiting:
                assert all(tasks[each].state is S.COMPLETED for each in self.done), tasks
                return
            for each in waiting:
                if each.state is S.HELD or self._is_in_wrong_mode(each):
                    self._help(each)
            self.world.run(1.0)
        raise AssertionError(f"not over: {waiting}")

    def _is_in_wrong_mode(self, task: Task) -> bool:
        """Return whether a rover has not heard its last gateway's HOLD, as a text says."""
        waits = (each for each in self.world.shared.store.events if isinstance(each, TaskWaits))
        told = any((each.task_id, each.reason) == (task.id, R.WRONG_MODE) for each in waits)
        return task.state is S.QUEUED and told

    def _help(self, task: Task) -> None:
        """Do what an operator does who looks at a task that does not go on."""
        it = next(each for each in self.world.gateways.values() if well(each))
        self.client.server = f"{it.name}:clients"
        self.has_paused = True
        self.client.mode(HOLD, target=(task.vehicle, 1))
        self.world.run(AGAIN)
        self.client.proceed(target=(task.vehicle, 191))
        self.world.run(AGAIN)
        if self._tasks()[int(task.id)].state is S.HELD:
            self.client.command(RELEASE, int(task.id), FROM_HERE, target=(task.vehicle, 191))
            self.world.run(AGAIN)


@pytest.mark.slow
@pytest.mark.timeout(0)
@pytest.mark.parametrize("first", range(0, SEEDS, AT_ONCE))
def test_chains_over_gateways_with_faults(first: int) -> None:
    for seed in range(first, first + AT_ONCE):
        with TemporaryDirectory() as folder:
            life = Chains(Path(folder), seed)
            life.live()
            assert early_starts(life.world.shared.store.events) == [], f"seed {seed}"
            assert life.wrong == [], f"seed {seed}: {life.wrong[:3]}"
            life.world.check()
