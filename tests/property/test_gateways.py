"""Gateways with their engines over one model database, with faults by seed, tasks under way.

No gateway moves a rover that it does not hold; no acknowledged task is lost or driven twice; and
after the faults every task is done.
"""

from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from mav_tasks.settings import Settings
from mav_tasks.tasks.events import QueuePaused
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.client import ACCEPTED, DENIED, HOLD
from tests.kit.gateways.engines import FleetWorld, Gateway, moves
from tests.kit.volume import tries

NAMES = ("server", "b", "c")
METRES = 1.0
#: m; the most that a rover drives on without set-points (3 s). If that is past its task's end, the
#: task is held, and its remainder is driven from there
ROLLED = 2.0
AGAIN = 5.0  # s; a client's same request within four is a copy of the first
RELEASE, REMAINDER, SKIP = 54013, 1, 2
SEEDS = tries(6, long=1000)  # 0.7 s each
AT_ONCE = 6


class Life:
    """One fleet, and what happens to it."""

    def __init__(self, folder: Path, seed: int, *, on_takeover: str = "resume", **kw: Any) -> None:
        self.chance = Random(seed)
        settings = Settings(on_takeover=on_takeover, on_restart="continue")
        self.world = FleetWorld(folder, names=NAMES, seed=seed, settings=settings, **kw)
        self.world.slow = 0.01
        self.world.watched.to_clients.clear()  # words wait at gateways that pass them on
        for observer in self.world.observers:
            observer.expects_gaps = True  # a gateway that failed leaves one
            observer.longest_gap = settings.watch.late_tick  # of one that stood still
        self.client = self.world.client
        self.wrong: list[str] = []
        self.motions = 0
        self.world.watched.loses = self._look
        self.done: list[int] = []
        self.released = 0  # times
        self.skipped: set[int] = set()
        self.has_paused = False  # the operator

    def _look(self, source: str, target: str, data: bytes) -> bool:
        if target == "rover1" and source.endswith(":vehicles") and moves(data):
            self.motions += 1
            name, holder = source.partition(":")[0], self.world.database.holder(1)
            if holder != name:
                self.wrong.append(f"{self.world.now:.3f}: {name} moves it, held by {holder}")
        return False

    def submit(self) -> int:
        """Submit a move at any gateway until it is acknowledged; return its id."""
        nonce, tries = self.chance.randrange(1, 1 << 24), []
        for _ in range(60):
            those = [each for each in self.world.gateways.values() if well(each)]
            if not those:
                self.world.run(1.0)
                continue
            it = self.chance.choice(those)
            self.client.server = f"{it.name}:clients"
            tries.append(self.client.move(METRES, nonce=nonce))
            self.world.run(1.0)
            for sent in tries:  # all mean the same task
                if sent.result == ACCEPTED:
                    return sent.task_id
        raise AssertionError(f"no acknowledgement: {self.world.describe()}")

    def disturb(self) -> None:
        """Do something bad to one gateway, or to the database, for a while."""
        world, chance = self.world, self.chance
        it = chance.choice(list(world.gateways.values()))
        last = chance.uniform(0.05, 3.0)
        if not well(it):
            return
        match chance.randrange(10):
            case 0:
                world.kill(it.name)
                self._later(last, lambda: world.start(it.name))
            case 1:
                world.freeze(it.name)
                self._later(last, lambda: setattr(it, "is_frozen", False))
            case 2:
                self._reach(it, is_reached=False)
                self._later(last, lambda: self._reach(it, is_reached=True))
            case 3:
                world.end(it.name)
                self._later(last, lambda: world.start(it.name))
            case 4:  # the rover drives out of its reach
                world.cut(it.name)
                self._later(3 * last, lambda: world.mend(it.name))
            case 5:
                it.set_clock(chance.choice((3_600.0, -3_600.0, 5.0, -5.0, 0.0)))
            case 6:
                world.database.sessions.pop(it.name, None)
            case 7:  # what it asks is carried out, and it does not hear so
                it.hears = False
                self._later(last, lambda: setattr(it, "hears", True))
            case 8:
                it.is_pinged = False
                self._later(last, lambda: setattr(it, "is_pinged", True))
            case _:
                world.database.restart()
                world.database.is_up = False
                self._later(last / 2, lambda: setattr(world.database, "is_up", True))

    def _reach(self, it: Gateway, *, is_reached: bool) -> None:
        it.is_reached = it.store.is_reached = is_reached

    def _later(self, delay: float, what: object) -> None:
        at = self.world.now + delay
        is_done: list[bool] = []

        def do(now: float) -> None:
            if now >= at and not is_done:
                is_done.append(True)
                what()  # type: ignore[operator]

        self.world.watch(do)

    def _set_hold(self) -> None:
        self.has_paused = True
        self.client.mode(HOLD)
        self.world.run(AGAIN)
        self.client.proceed()
        self.world.run(AGAIN)

    def live(self) -> None:
        """Submit some tasks, with faults; then let all be done."""
        self.world.run(5.0)
        for _ in range(3):
            self.done.append(self.submit())
            for _ in range(self.chance.randrange(3)):
                self.world.run(self.chance.uniform(0.0, 2.0))
                self.disturb()
        self.world.run(4.0)

        for _ in range(120):
            tasks = {int(task.id): task for task in self.world.shared.tasks()}
            driven = set(self.done) - self.skipped
            if all(tasks[each].state is S.COMPLETED for each in driven):
                self.world.run(2.0)
                return
            held = [each for each in tasks.values() if each.state is S.HELD]
            for each in held:  # an operator looks at it
                sent = self.client.command(RELEASE, int(each.id), REMAINDER)
                self.released += 1
                self.world.run(AGAIN)
                if sent.answer == (DENIED, R.OFF_TRACK):  # it has rolled past the task's end
                    self.client.command(RELEASE, int(each.id), SKIP)
                    self.skipped.add(int(each.id))
                elif sent.ack is not None and sent.result != ACCEPTED:
                    self._set_hold()  # it has not heard its last gateway's HOLD: wrong mode
            self.world.run(1.0)
        raise AssertionError(f"not done: {tasks}")


def well(it: Gateway) -> bool:
    return not it.is_dead and not it.is_frozen and it.is_reached


@pytest.mark.slow
@pytest.mark.timeout(0)
@pytest.mark.parametrize("first", range(0, SEEDS, AT_ONCE))
def test_faults_of_gateways_in_virtual_time(first: int) -> None:
    for seed in range(first, first + AT_ONCE):
        with TemporaryDirectory() as folder:
            life = Life(Path(folder), seed)
            life.live()
            assert life.wrong == [], f"seed {seed}: {life.wrong[:3]}"
            assert life.motions > 20, f"seed {seed}"
            taken = [e for e in life.world.shared.store.events if isinstance(e, QueuePaused)]
            assert taken == [] or life.has_paused, (
                f"seed {seed}: nobody has taken the rover over, but {taken}"
            )
            more = life.world.truth.north - METRES * len(life.done)
            least = -0.1 - METRES * len(life.skipped)
            assert least < more < 0.1 + ROLLED * life.released, f"seed {seed}: {more}"
            life.world.check()
            life.world.shared.store.close()
