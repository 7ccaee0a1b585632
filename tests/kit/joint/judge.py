"""Judges each deed by the rover's true pose: a held rover stands until it is released."""

from math import hypot
from typing import NamedTuple

from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from rover_sim.personas import Mode
from tests.kit.client import ACCEPTED, Sent
from tests.kit.joint.deeds import CLEAR, DEEDS, Deed, Kind, Scene

LOOK = 0.1  # s
MOVED = 0.05  # m, of a held rover
WAY_OUT = -1  # instead of a deed: check that there is a way out
COMPLETES = 40.0  # s for a metre, including waits


class State(NamedTuple):
    """The distinguishing state of a vehicle's control, without figures."""

    queue: str  # why it is paused; NONE: it runs
    phase: str  # of the server's control
    mode: str
    armed: bool
    may_arm: bool
    active: str  # state and reason of the active task
    waiting: int  # tasks, at most 1
    immediate: bool
    grants: bool
    marked: bool  # its mission starts when it is armed
    heard: bool
    streams: bool
    moves: bool
    holds: frozenset[str]  # what holds it, by the rule


class Report(NamedTuple):
    """The result of a deed."""

    state: State
    wrong: tuple[str, ...]


class Judge:
    """Does deeds in a scene, and tracks what holds the rover."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._holds: set[str] = set()
        self._pose = scene.world.pose()
        self._seen = 0  # number of the observer's violations

    def __repr__(self) -> str:
        return f"Judge({sorted(self._holds)})"

    @property
    def _vehicle(self) -> Vehicle:
        vehicle = self.scene.world.server.engine._vehicles.look_at(1)
        assert vehicle is not None
        return vehicle

    def do(self, number: int) -> Report:
        """Do one deed, let its time pass, and judge."""
        if number == WAY_OUT:
            return Report(self.state(), tuple(self._find_way_out()))
        deed, world = DEEDS[number], self.scene.world
        was_paused, was_armed = world.paused(), world.rover.autopilot.armed
        was_mode, was_moving = world.rover.autopilot.mode, not world.stands()
        sent = deed.act(self.scene)
        moved, armed = 0.0, False
        for _ in range(round(deed.takes / LOOK)):
            world.run(LOOK)
            north, east, _ = world.pose()
            moved = max(moved, hypot(north - self._pose[0], east - self._pose[1]))
            armed |= world.rover.autopilot.armed and not was_armed
        self._let_go(deed, sent)
        wrong = []
        if self._holds and moved > MOVED:
            wrong.append(f"moved {moved:.2f} m though held by {sorted(self._holds)}")
        if "disarm" in self._holds and armed:
            wrong.append("armed though somebody has disarmed it")
        left = was_paused is TaskReason.STOPPED and world.paused() is not TaskReason.STOPPED
        if left and deed.kind is not Kind.CONTINUE:
            wrong.append("STOP is latched no more")
        self._hold(deed, sent, was_mode=was_mode, was_moving=was_moving, was_armed=was_armed)
        if self._holds and deed.kind in (Kind.HALT, Kind.DISARMING) and not world.stands():
            wrong.append(f"not standing {deed.takes} s after it")
        violations = world.observer.violations
        wrong += violations[self._seen :]
        self._seen = len(violations)
        self._pose = world.pose()
        return Report(self.state(), tuple(wrong))

    def state(self) -> State:
        """Return the present state."""
        world, vehicle = self.scene.world, self._vehicle
        tasks, autopilot = vehicle.tasks, world.rover.autopilot
        active = tasks.active
        client = self.scene.client.name
        granted = [key for key in vehicle.parts.authority._granted if client in str(key)]
        return State(
            queue=tasks.paused.name,
            phase=vehicle.control.phase.name,
            mode=autopilot.mode.name,
            armed=autopilot.armed,
            may_arm=vehicle.parts.authority.may_arm,
            active="" if active is None else f"{active.state.name} {active.reason.name}",
            waiting=min(len(tasks.waiting), 1),
            immediate=tasks.immediate is not None,
            grants=bool(granted),
            marked=vehicle.start_mark.is_put(now=world.now),
            heard=vehicle.is_heard(now=world.now),
            streams=self.scene.streams,
            moves=not world.stands(),
            holds=frozenset(self._holds),
        )

    def _let_go(self, deed: Deed, sent: Sent | None) -> None:
        """Remove the holds that a newer request has lifted."""
        runs = self.scene.world.paused() is TaskReason.NONE
        is_to_run = self._vehicle.tasks.immediate is not None
        is_accepted = sent is not None and sent.result == ACCEPTED
        match deed.kind:
            case Kind.CONTINUE if is_accepted:
                self._holds.clear()
            case Kind.ARMED:
                self._holds.discard("disarm")
            case Kind.ARMING if is_accepted or self.scene.is_silent:  # its answer was lost
                self._holds.discard("disarm")
            case Kind.GRANT if is_accepted:
                self._holds.discard("halt")
            case Kind.GO if is_accepted and (runs or is_to_run):
                self._holds.discard("halt")
            case Kind.WISH if is_accepted and runs:
                self._holds.discard("halt")

    def _hold(
        self,
        deed: Deed,
        sent: Sent | None,
        *,
        was_mode: Mode,
        was_moving: bool,
        was_armed: bool,
    ) -> None:
        """Add the hold of a request, or of an action at the rover."""
        world = self.scene.world
        is_accepted = sent is not None and sent.result == ACCEPTED
        drove = was_mode is Mode.MANUAL or (was_mode is not Mode.HOLD and was_moving)
        match deed.kind:
            case Kind.HALT if is_accepted:
                self._holds.add("halt")
            case Kind.DISARMING if is_accepted:
                self._holds.add("disarm")
            case Kind.DISARMED if was_armed and not self.scene.is_silent:
                self._holds.add("disarm")
            case Kind.PARKING if was_mode is not Mode.HOLD and was_armed:
                if drove or world.paused() is not TaskReason.NONE:
                    self._holds.add("halt")

    def _find_way_out(self) -> list[str]:
        """Return problems on a person's way out: clear, HOLD, continue, a task."""
        scene, world = self.scene, self.scene.world
        scene.client.end_streams()
        world.watched.loses = lambda *_: False
        world.run(5)
        scene.client.command(CLEAR, 1)
        world.run(3)
        if world.rover.autopilot.mode is not Mode.HOLD:
            world.operator_mode(Mode.HOLD)
            world.run(2)
        scene.client.proceed()
        world.run(2)
        sent = scene.client.move(1.0)
        for _ in range(round(COMPLETES / LOOK)):
            world.run(LOOK)
            if sent.ack is None:
                continue
            if sent.result != ACCEPTED:
                return [f"no way out: a task is refused, {sent.answer}"]
            if world.state(sent.task_id)[0] is TaskState.COMPLETED:
                return []
        return [f"no way out: {world.describe()}"]
