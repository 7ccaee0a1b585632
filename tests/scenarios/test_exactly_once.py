"""One submission, one task: whatever the net loses, doubles and puts out of order."""

from dataclasses import dataclass, field
from random import Random

import pytest

from mav_tasks.config.settings import Queueing, Settings
from mav_tasks.links.memory import Conditions
from mav_tasks.tasks.events import TaskSubmitted
from tests.kit.cases import for_each
from tests.kit.client import MOVE, REPEATS, TASK_STATUS, FakeClient, TaskStatus, command_long
from tests.kit.volume import tries
from tests.scenarios.conftest import MakeWorld

TERRIBLE = Conditions(loss=0.3, duplication=0.3, delay=0.02, jitter=0.3)
ROOMY = Settings(queueing=Queueing(capacity=20_000, quota=20_000))
CLIENTS, EACH = 10, tries(200, long=1_000)
AT_ONCE = 40  # submissions of one client under way
AGAIN = 0.4  # s between the copies of one


@dataclass
class Submitter:
    """A client that sends each submission until it is told, by its nonce, which task it is."""

    client: FakeClient
    random: Random
    left: list[int]
    under_way: dict[int, float] = field(default_factory=dict)
    known: dict[int, int] = field(default_factory=dict)
    read: int = 0

    def turn(self, now: float) -> None:
        for packet in self.client.received[self.read :]:
            if packet.message_id == TASK_STATUS:
                status = TaskStatus.of(packet.payload)
                if status.nonce in self.under_way:
                    del self.under_way[status.nonce]
                    self.known[status.nonce] = status.task_id
        self.read = len(self.client.received)
        while self.left and len(self.under_way) < AT_ONCE:
            self.under_way[self.left.pop()] = -1.0
        for nonce, sent_at in self.under_way.items():
            if now - sent_at >= AGAIN:
                self.under_way[nonce] = now + self.random.uniform(0, 0.1)
                distance = 1 + nonce % 7  # many ask for the very same
                self.client.send(command_long(MOVE, distance, 0, 0, nonce, 0, 0, 5))

    @property
    def is_done(self) -> bool:
        return not self.left and not self.under_way


@pytest.mark.timeout(300)
def test_submissions_with_nonces_are_as_many_tasks(make_world: MakeWorld) -> None:
    world = make_world(seed=3, settings=ROOMY)
    world.client.pause()
    world.run(0.2)
    world.net.conditions = TERRIBLE
    submitters = []
    for number in range(CLIENTS):
        client = world.add_client(f"client {number}", system_id=100 + number)
        nonces = Random(number).sample(range(1, 1 << 24), EACH)
        submitters.append(Submitter(client, Random(number), nonces))
    sent = {(100 + n, nonce) for n, s in enumerate(submitters) for nonce in s.left}
    while not all(submitter.is_done for submitter in submitters):
        assert world.now < 600
        for submitter in submitters:
            submitter.turn(world.now)
        world.run(0.05)
    tasks = world.tasks()
    assert len(tasks) == CLIENTS * EACH == len(world.events(TaskSubmitted))
    assert {(t.submitter.system_id, t.marks.nonce) for t in tasks} == sent
    nonce_of: dict[int, int] = {task.id: task.marks.nonce for task in tasks}
    for submitter in submitters:
        assert len(submitter.known) == EACH
        for nonce, task_id in submitter.known.items():
            assert nonce_of[task_id] == nonce


@for_each("seed", range(tries(2, long=20)))
def test_without_nonces_who_repeats_as_mavsdk_does_gets_one_task(
    make_world: MakeWorld, seed: int
) -> None:
    world = make_world(seed=seed, settings=ROOMY)
    world.client.pause()
    world.run(0.2)
    world.net.conditions = TERRIBLE
    answered = 0
    for number in range(60):
        sent = world.client.move(1 + number / 8, repeats=REPEATS)
        world.run(3.0)  # longer than its last copy can be on the way
        answered += sent.ack is not None
    distances = [event.task.goal for event in world.events(TaskSubmitted)]
    assert len(distances) == len(set(distances)) >= answered > 50
