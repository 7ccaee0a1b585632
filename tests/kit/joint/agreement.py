"""Checks that the server agrees with the model of joint control, at each event.

``graph`` explores the states of the model, which proves something about the server only if both
agree.
"""

from collections.abc import Callable
from functools import cache, partial
from typing import Any

import pytest

from mav_tasks.engine.vehicles.control import Event, State
from mav_tasks.engine.vehicles.joint_control import JointControl, Word
from rover_sim.personas import Mode
from tests.kit.client import GUIDED, HOLD, MOVE, setpoint
from tests.kit.joint.model import FREE, happens
from tests.kit.mission import Item, Upload
from tests.kit.px4 import ask_mode
from tests.kit.world import World, at

LEFT_OPEN: dict[str, Any] = dict.fromkeys(FREE, False)
WAYPOINT, START, CANCEL, CLEAR, RELEASE = 16, 300, 54010, 54011, 54013
PX4_HOLD, PX4_OFFBOARD = 3 << 24 | 4 << 16, 6 << 16
SPEED = 0.5  # m/s of the client's setpoint stream
LATER = 6.0  # s until the start of the later task


class Agreement:
    """Checks every event of every vehicle, and records transitions that the model lacks."""

    def __init__(self) -> None:
        self.surprises: list[str] = []
        self.compared = 0
        self._is_within = False

    def look_on(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Start checking."""
        done = JointControl.on

        def on(joint: JointControl, event: Event, word: Word, *, now: float) -> Any:
            if self._is_within:
                return done(joint, event, word, now=now)
            joint.decide(now=now)  # an event of its own, which is compared, too
            self._is_within = True
            try:
                before = joint.state(now=now)
                result = done(joint, event, word, now=now)
                self._compare(event, before, joint.state(now=now))
            finally:
                self._is_within = False
            return result

        monkeypatch.setattr(JointControl, "on", on)

    def _compare(self, event: Event, before: State, there: State) -> None:
        self.compared += 1
        if _open(there) not in _expected(event, before):
            self.surprises.append(f"{event.name} in {before}: {there}")


@cache
def _expected(event: Event, before: State) -> frozenset[State]:
    return frozenset(map(_open, happens(event, before)))


def _open(state: State) -> State:
    return state._replace(**LEFT_OPEN)


def deeds(world: World) -> list[Callable[[], object]]:
    """Return what clients, a person at the rover and failures may do to a world.

    One client releases the rover, the other one halts it.
    """
    client, person, autopilot = world.client, world.add_client("person"), world.rover.autopilot
    is_px4 = world.server.engine.snapshot(now=world.now).vehicles[0].persona == "px4"
    home = () if is_px4 else (Item(WAYPOINT, frame=0, current=1),)
    upload = Upload(client, (*home, Item(WAYPOINT, **at(30.0, 0.0))), target=(1, 1))
    world.until(lambda: upload.result == 0, within=5)

    def mode(who: Any, px4: int, ardupilot: int) -> object:
        return ask_mode(who, px4) if is_px4 else who.mode(ardupilot)

    def silence(is_silent: bool) -> None:
        world.watched.loses = lambda source, _target, _data: is_silent and source == "rover1"

    return [
        person.stop,
        lambda: mode(person, PX4_HOLD, HOLD),
        person.pause,
        lambda: person.arm(False),
        client.proceed,
        client.arm,
        lambda: mode(client, PX4_OFFBOARD, GUIDED),
        lambda: client.command(START, target=(1, 1)),
        lambda: client.command(RELEASE, 0, 0),
        lambda: client.move(30.0),
        lambda: client.command(MOVE, 30, 0, 0, 0, 0, LATER, 5),
        lambda: client.command(CANCEL),
        lambda: client.command(CLEAR, 1),
        lambda: client.stream(setpoint(SPEED), rate=10),
        client.end_streams,
        *(partial(world.operator_mode, each) for each in (Mode.HOLD, Mode.MANUAL, Mode.GUIDED)),
        *(partial(world.operator_arm, each) for each in (False, True)),
        *(partial(silence, each) for each in (True, False)),
        lambda: autopilot.reboot(now=world.now),
    ]
