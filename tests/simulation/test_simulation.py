"""The main test: stories of server, rovers, clients and people, and what holds in each of them."""

import os
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Settings
from mav_tasks.shell.in_memory import CLIENT_LINK, VEHICLE_LINK
from mav_tasks.tasks.events import TaskChanged, TaskSubmitted
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.task import TaskId
from rover_sim.body import BodyState
from rover_sim.faults import Faults
from rover_sim.frames import Frame
from rover_sim.personas import ARDUPILOT, Mode
from tests.kit import bounds
from tests.kit.bounds import Violation
from tests.kit.client import GUIDED, SET_MODE, TaskStatus, command_long, setpoint
from tests.kit.observer import Observer
from tests.kit.volume import tries
from tests.simulation import invariants
from tests.simulation.faults import FAULTS
from tests.simulation.fleet import SimulatedFleet
from tests.simulation.invariants import INVARIANTS, Stillness
from tests.simulation.judged import Asked, Driven
from tests.simulation.moves import Found, play
from tests.simulation.shrink import shrink
from tests.simulation.story import Cast, Move, tell
from tests.simulation.world import SimulatedWorld

SIMULATE = Path(__file__).resolve().parents[2] / "tools/simulate"
SECONDS, STORIES = 60.0, 10  # of a story, and stories of a test
FOUND_SOON = "D1 an older go is obeyed", 1  # a fault, and a seed that finds it in 20 s


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("first", range(0, STORIES * tries(2, long=100), STORIES))
def test_whatever_happens_no_rule_is_broken(first: int) -> None:
    for seed in range(first, first + STORIES):
        story = tell(seed, SECONDS)
        found = play(story)
        if found.rule:
            again = f"repeat it: tools/simulate --seed {seed}"
            pytest.fail(f"{shrink(story, found)}\n{found.at:.2f} s  {found.text}\n\n{again}")
        assert found.counts["packets"] > 1_000


@pytest.mark.slow
def test_the_same_seed_is_the_same_story_whatever_the_hashes() -> None:
    outputs = [
        subprocess.run(
            [SIMULATE, "--seed", "4", "--seconds", "9"],
            env={**os.environ, "PYTHONHASHSEED": hashes},
            capture_output=True,
            text=True,
            check=True,
            timeout=150,
        ).stdout
        for hashes in ("1", "12345")
    ]
    assert outputs[0] == outputs[1]
    assert "no rule is broken; digest" in outputs[0]


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_fault_is_found_and_told_as_a_short_story() -> None:
    fault, seed = FOUND_SOON
    ended = subprocess.run(
        [SIMULATE, "--fault", fault, "--seed", f"{seed}", "--seconds", "20"],
        capture_output=True,
        text=True,
        check=False,
        timeout=500,
    )
    assert ended.returncode == 1, ended.stdout + ended.stderr
    first, *moves, last = [line for line in ended.stdout.splitlines() if line]
    assert first.startswith(f"seed {seed}: ")
    assert len(moves) < 8, ended.stdout
    assert any("once more" in line for line in moves)
    assert last == f"repeat it: tools/simulate --seed {seed} --seconds 20"


def test_a_story_is_shrunk_to_the_moves_that_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a rule that a person must not switch to MANUAL."""

    def no_manual(world: SimulatedWorld) -> Iterator[str]:
        if world.rover.autopilot.mode is Mode.MANUAL and world.now > 4.0:
            yield "somebody has switched to MANUAL"

    monkeypatch.setitem(INVARIANTS, "no MANUAL", (0.0, no_manual))
    story = tell(13, 8.0)  # of PX4s, which boot in HOLD
    switch = Move(6.0, 999, "person at rover 1", "switch", ("MANUAL",))
    story = replace(story, moves=tuple(sorted((*story.moves, switch))))
    found = play(story)
    assert found.rule == "Violation: no MANUAL: somebody has switched to MANUAL"
    assert len(story.moves) > 5
    assert shrink(story, found).moves == (switch,)
    assert str(switch) == "   6.00 s  person at rover 1: switch (MANUAL)"


# every rule is able to fail

CAST = Cast("ardupilot", Frame.SKID, 1, ("MAVSDK", "script"), "pause", "pause", 0)


@pytest.fixture
def world(tmp_path: Path) -> Iterator[SimulatedWorld]:
    world = SimulatedWorld(tmp_path, CAST, seed=0, persona=ARDUPILOT, settings=Settings())
    world.client = world.clients[0]
    world.ready()
    yield world
    world.disk.close()


def drive(world: SimulatedWorld) -> None:
    world.client.move(30, nonce=7)
    world.until_state(1, S.EXECUTING)
    world.run(1)


def of_server(message: Any) -> bytes:
    packed: bytes = message.pack(common.MAVLink(None, 250, 191))
    return packed


def drives_a_paused_rover(world: SimulatedWorld) -> None:
    drive(world)
    world.client.pause()
    world.run(4)
    world.fault(Faults(withheld=frozenset({0})))  # its heartbeat would show it at once
    world.bring_late(of_server(command_long(SET_MODE, 1, GUIDED, target=(1, 1))))
    for _ in range(40):
        world.bring_late(setpoint(0.5).pack(common.MAVLink(None, 9, 1)))
        world.run(0.1)


def sends_no_number(world: SimulatedWorld) -> None:
    world.net.send(VEHICLE_LINK, "rover1", of_server(setpoint(float("nan"))))


def moves_by_itself(_world: SimulatedWorld) -> None:
    rolls = SimpleNamespace(
        truth=BodyState(0, 0, 0, 0, 0, 0, 0, 0.3, 0, 0),
        autopilot=SimpleNamespace(armed=True, mode=Mode.HOLD),
    )
    still: Any = Stillness(rolls, Observer(), stops_within=1.0)  # type: ignore[arg-type]
    raise Violation(*still.look(10.0))


def forgets_a_task(world: SimulatedWorld) -> None:
    world.ledger.accepted.add(99)


def leaves_a_command(world: SimulatedWorld) -> None:
    world.asked["client 0", 400] = Asked(copies=1, latest=world.now - 60)


def answers_twice(world: SimulatedWorld) -> None:
    world.client.arm(False)
    world.run(1)
    ack = common.MAVLink_command_ack_message(400, 0).pack(common.MAVLink(None, 1, 1))
    world.net.send(CLIENT_LINK, "client 0", ack)


def loses_a_stop(world: SimulatedWorld) -> None:
    world.client.stop()
    world.run(1)
    world.disk_store.events.clear()
    world.kill()
    world.start()


def completes_at_once(world: SimulatedWorld) -> None:
    drive(world)
    world.driven[1] = Driven(5.0, 0.0, rover=1, since=replace(world.ways[0]))
    world.faults += invariants.not_driven(world, 1)


def takes_from_a_halted_rover(world: SimulatedWorld) -> None:
    world.client.arm(False)
    world.run(1)
    world.faults += invariants.taken_from_halted(world, 7, 1)


def has_no_way_out(world: SimulatedWorld) -> None:
    world.watched.cut.add(frozenset((VEHICLE_LINK, "rover1")))
    world.faults += invariants.way_out(world)


def is_deaf_to_stop(world: SimulatedWorld) -> None:
    drive(world)
    world.watched.cut.add(frozenset((CLIENT_LINK, "client 0")))
    world.faults += invariants.stops(world)


def doubles_a_task(world: SimulatedWorld) -> None:
    drive(world)
    (event,) = (e for e in world.disk_store.events if isinstance(e, TaskSubmitted))
    world.disk_store.events.append(replace(event, task=replace(event.task, id=TaskId(2))))


def begins_after_its_end(world: SimulatedWorld) -> None:
    drive(world)
    world.client.stop()
    world.until_state(1, S.KILLED)
    killed = next(
        e for e in world.disk_store.events if isinstance(e, TaskChanged) and e.new is S.KILLED
    )
    world.disk_store.events.append(replace(killed, old=S.KILLED, new=S.STARTING))


def tells_another_end(world: SimulatedWorld) -> None:
    drive(world)
    for version, state in ((30, S.COMPLETED), (31, S.FAILED)):
        told = TaskStatus.of(bytes(132))._replace(task_id=1, version=version, state=int(state))
        world.faults += world.ledger.tell(told, "client 0")


def remembers_everything(_world: SimulatedWorld) -> None:
    """See the fixture ``small``."""


BREAKS: dict[Callable[[SimulatedWorld], None], str] = {
    sends_no_number: "packets to rovers: rover 1: .*setpoint not finite",
    drives_a_paused_rover: "halted rovers stand: rover 1 is let go after pause",
    moves_by_itself: "rover 1 moves, and nobody drives it",
    forgets_a_task: "tasks are kept: task 99 was accepted, and is lost",
    leaves_a_command: "commands are answered: command 400 of client 0 is not answered",
    remembers_everything: "memory is bounded: .* holds ",
    answers_twice: "command 400 of client 0 is answered 2 times",
    loses_a_stop: "STOP of rover 1 was acknowledged, and is lost by the restart",
    completes_at_once: "task 1 is completed after 0.00 of 5.00 m",
    takes_from_a_halted_rover: "task 7 is taken from rover 1 after disarm",
    has_no_way_out: "no way out of rover 1: ",
    is_deaf_to_stop: "does not stand in the end",
    doubles_a_task: "one submission of nonce 7 is task 1 and 2",
    begins_after_its_end: "task 1 goes from KILLED to STARTING",
    tells_another_end: "client 0 was told COMPLETED, then FAILED of task 1",
}


@pytest.mark.parametrize("breaks", BREAKS, ids=lambda breaks: breaks.__name__)
def test_every_rule_is_able_to_fail(
    world: SimulatedWorld, breaks: Callable[[SimulatedWorld], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    world.run(1)
    world.judge(world.now, everything=True)
    if breaks is remembers_everything:
        monkeypatch.setattr(bounds, "MOST", 3)
        monkeypatch.setattr(bounds, "LARGER", {})

    def break_it() -> None:
        breaks(world)
        world.run(0.2)
        world.judge(world.now, everything=True)

    with pytest.raises(Violation, match=BREAKS[breaks]):
        break_it()


def test_a_gateway_that_moves_what_it_does_not_have_is_found(tmp_path: Path) -> None:
    fleet = SimulatedFleet(
        tmp_path, replace(CAST, gateways=2), seed=0, persona=ARDUPILOT, settings=Settings()
    )
    fleet.ready()
    (other,) = set(fleet.gateways) - {fleet.database.holder(1)}
    fleet.net.send(f"{other}:vehicles", "rover1", of_server(setpoint(0.0)))
    fleet.judge(fleet.now, everything=True)
    fleet.net.send(f"{other}:vehicles", "rover1", of_server(setpoint(0.5)))
    with pytest.raises(Violation, match=f"gateway {other} moves rover1, which "):
        fleet.judge(fleet.now, everything=True)
    fleet.close()


def test_every_rule_of_the_list_has_a_case_above() -> None:
    told = " ".join(BREAKS.values())
    assert [
        name for name in INVARIANTS if name not in told and name != "undriven rovers stand"
    ] == []
    assert FOUND_SOON[0] in FAULTS
    assert Found().rule == ""
