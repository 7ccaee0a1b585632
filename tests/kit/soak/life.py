"""One life: a seed decides who takes part, what fails, and all actions with their times."""

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from time import process_time

from pymavlink.dialects.v20 import common

from mav_tasks.in_memory import CLIENT_LINK, VEHICLE_LINK
from mav_tasks.links.memory import Conditions
from mav_tasks.settings import Clients, Driving, Queueing, Settings
from mav_tasks.tasks.lifecycle import TERMINAL
from rover_sim.faults import Faults
from rover_sim.personas import PX4, Mode
from tests.kit import px4
from tests.kit.client import HOLD, FakeClient
from tests.kit.soak.attacks import Attacks
from tests.kit.soak.deeds import Deed, Stage, deeds, px4_deeds, upload
from tests.kit.soak.figures import Figures
from tests.kit.soak.mutants import Mutants
from tests.kit.soak.world import SoakWorld
from tests.kit.world import PROMPT

PERSONAS = (PROMPT, PROMPT, px4.PROMPT_PX4, PX4, px4.PROMPT_GENERIC)
NETS = (
    Conditions(delay=0.002),
    Conditions(delay=0.002, jitter=0.02, duplication=0.1),
    Conditions(delay=0.01, jitter=0.05, loss=0.05, duplication=0.1),
    Conditions(delay=0.02, loss=0.2),
)
PAUSES = (0.01, 0.1, 0.5, 2.0)  # s, between two actions
CANCEL, CLEAR, MODIFY, RELEASE = 54010, 54011, 54012, 54013
SPEEDS = ("TSK_SPEED", "TSK_TURN", "TSK_ACCEL", "TSK_ACC_RAD", "no such one")


class SoakStage(Stage):
    """A stage that reports actions of people at the rovers to its world."""

    def person_turns(self, number: int, mode: Mode) -> None:
        """Let a person turn the mode switch at a rover."""
        assert isinstance(self.world, SoakWorld)
        self.world.person_turns(number, mode)

    def person_arms(self, number: int, armed: bool) -> None:
        """Let a person arm or disarm a rover."""
        assert isinstance(self.world, SoakWorld)
        self.world.person_arms(number, armed=armed)


class Life:
    """A world with random actions until its time is over; the same seed gives the same life."""

    def __init__(self, seed: int, folder: Path) -> None:
        self.seed = seed
        self._random = random = Random(seed)
        persona = random.choice(PERSONAS)
        settings = Settings(
            driving=Driving(max_speed=1.0),
            queueing=Queueing(
                capacity=20, quota=30, preemption_gap=random.choice((0, 3)), preemption_rest=0.3
            ),
            on_restart=random.choice(("pause", "continue")),
            on_failure=random.choice(("pause", "continue")),
            clients=Clients(stream_interval=0.5),
        )
        self.world = SoakWorld(
            folder,
            seed=seed,
            rovers=random.choice((1, 1, 1, 2, 3)),
            persona=persona,
            conditions=NETS[0],
            settings=settings,
        )
        for vehicle in self.world.rovers:
            vehicle.autopilot.parameters[persona.speed_parameter] = 0.8
        world = self.world.ready()
        clients = [world.client] + [
            self.world.add_soaked_client(f"client{number}", system_id=200 + number)
            for number in range(random.choice((1, 2, 3)))
        ]
        self._stage = SoakStage(world, random, self.world.disk_store, clients, self._note)
        is_px4 = persona.name != PROMPT.name
        of_chaos = (px4_deeds if is_px4 else deeds)(self._stage)
        wishes = self._wishes()
        attacks = Attacks(self.world, self._stage)
        self._deeds = [*of_chaos, *wishes, *wishes, *self._surroundings(), self._bad_input]
        self._deeds += attacks.deeds()
        self._mutants = Mutants(random)

    def __repr__(self) -> str:
        return f"Life(seed {self.seed}, {self.world.now:.1f} s)"

    def run(self, seconds: float) -> None:
        """Run for ``seconds``, then end. Raise Violation on an error."""
        end = self.world.now + seconds
        while self.world.now < end:
            self._random.choice(self._deeds)()
            self.world.run(self._random.choice(PAUSES))
        self._end()

    def figures(self) -> Figures:
        """Return the figures, without CPU time."""
        world = self.world
        return Figures(
            lives=1,
            virtual=world.now,
            tasks=len(world.ledger.given),
            packets=world.packets,
            restarts=world.restarts,
            faults=world.faults,
            deeds=world.deeds,
            halts=sum((each.halted for each in world.halts), Counter()),
            refused=sum((each.refused for each in world.halts), Counter()),
            in_flight=sum(each.in_flight for each in world.halts),
            broken=Counter(each.kind for each in world.broken),
        )

    def _end(self) -> None:
        """Clear faults and stop all rovers; check that all tasks are over and all rovers stand."""
        world = self.world
        for vehicle in world.rovers:
            vehicle.autopilot.set_faults(Faults())
        self._change_net(NETS[0])
        world.disk_store.delay = world.disk_store.broken_until = 0.0
        for client in self._stage.clients:
            client.end_streams()
        world.run(4)
        for number in range(1, len(world.rovers) + 1):
            for _ in range(3):
                world.client.stop(clear=True, target=(number, 191))
                world.run(0.3)
        world.run(6)
        world.judge_all()
        for number, vehicle in enumerate(world.rovers, 1):
            assert world.stands(number), f"seed {self.seed}: {vehicle!r} does not stand in the end"
        left = [task for task in world.tasks() if task.state not in TERMINAL]
        assert not left, f"seed {self.seed}: not over in the end: {left}"

    def _note(self, fault: str) -> None:
        self.world.faults[fault] += 1
        self.world.disturb(0)

    # clients' actions besides those of every stage

    def _wishes(self) -> list[Deed]:
        random, stage = self._random, self._stage

        def some_task() -> int:
            live = [task.id for task in self.world.tasks() if task.state not in TERMINAL]
            return random.choice(live) if live and random.random() < 0.9 else random.randrange(50)

        def to_server(command: int, *params: float) -> None:
            stage.client().command(command, *params, target=(stage.rover(), 191))

        def repeated_move() -> None:
            nonce, client = random.randrange(1, 1 << 24), stage.client()
            client.move(0.5, nonce=nonce, target=(stage.rover(), 191), repeats=(0.0, 0.5, 1.0, 3.0))

        def set_parameter() -> None:
            name, value = random.choice(SPEEDS), random.choice((0.3, 0.5, 45.0, -1.0, float("nan")))
            stage.client().send(
                common.MAVLink_param_set_message(stage.rover(), 191, name.encode(), value, 9)
            )

        return [
            repeated_move,
            lambda: upload(stage, component=191),
            lambda: to_server(CANCEL, some_task(), random.randrange(2)),
            lambda: to_server(CLEAR, random.randrange(2)),
            lambda: to_server(MODIFY, some_task(), random.randrange(1, 8), random.randrange(11)),
            lambda: to_server(RELEASE, 0, random.randrange(3)),
            lambda: to_server(RELEASE, 0, random.randrange(3)),
            set_parameter,
        ]

    # failures around the server

    def _surroundings(self) -> list[Deed]:
        random, world = self._random, self.world

        def restart() -> None:
            world.restart(away=random.choice((0.5, 3.0, 8.0)))
            self._stage.store = world.disk_store

        def break_disk() -> None:
            self._note("disk full")
            world.disk_store.break_for(random.choice((0.3, 2.0, 5.0)))

        def link_down() -> None:
            world.link_down(self._stage.rover(), random.choice((0.2, 1.0, 4.0)))

        def step_clock() -> None:
            world.step_wall_clock(random.choice((-3600.0, -1.0, 1.0, 86_400.0)))

        def change_net() -> None:
            self._note("net changes")
            self._change_net(random.choice(NETS))

        def hold_all() -> None:
            """Hold and continue all rovers, so that tasks drive again."""
            for number in range(1, len(world.rovers) + 1):
                client: FakeClient = self._stage.client()
                client.mode(HOLD, target=(number, 1))
                client.proceed(target=(number, 191))

        return [restart, break_disk, link_down, step_clock, change_net, *[hold_all] * 5]

    def _change_net(self, conditions: Conditions) -> None:
        self.world.net.conditions = conditions
        self.world.disturb(0)

    def _bad_input(self) -> None:
        """Send broken packets, from strangers and from known senders."""
        self._note("bad packets")
        for _ in range(20):
            mutant = self._mutants.broken()
            link, peers = self._random.choice(
                ((CLIENT_LINK, ("client", "stranger")), (VEHICLE_LINK, ("rover1", "stranger")))
            )
            self.world.net.send(self._random.choice(peers), link, mutant.data)


def live(seed: int, *, seconds: float, then: Callable[[Life], None] = lambda _: None) -> Figures:
    """Run one life; return its figures. Raise Violation, or any exception of the life."""
    began = process_time()
    with TemporaryDirectory(prefix="soak-") as folder:
        life = Life(seed, Path(folder))
        try:
            life.run(seconds)
            then(life)
        finally:
            life.world.disk.close()
    figures = life.figures()
    figures.cpu = process_time() - began
    return figures
