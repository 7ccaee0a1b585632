"""Builds the state that the table of joint control uses, from the parts of a vehicle."""

from collections.abc import Hashable

from mav_tasks.engine.vehicles.joint_state import NOTHING, Driver, Grip, Queue, State, Waits, Work
from mav_tasks.engine.vehicles.parts import Parts
from mav_tasks.engine.vehicles.pilot import Pilot
from mav_tasks.services.phase import Phase
from mav_tasks.tasks.lifecycle import RUNNING, TAKEN, TaskReason, TaskState
from mav_tasks.tasks.vehicle_tasks import VehicleTasks
from mav_tasks.tasks.view import ModeKind

GRIPS = {
    Phase.IDLE: Grip.FREE,
    Phase.LOOKING: Grip.TAKING,
    Phase.ASKING_HOLD: Grip.TAKING,
    Phase.ASKING_ARM: Grip.TAKING,
    Phase.LEADING_IN: Grip.TAKING,
    Phase.ASKING_MODE: Grip.TAKING,
    Phase.CONTROL: Grip.DRIVING,
    Phase.RELEASING: Grip.RELEASING,
    Phase.DISARMING: Grip.RELEASING,
    Phase.STOPPING: Grip.STOPPING,
}


def state_of(parts: Parts, pilot: Pilot, *, is_late: bool, now: float) -> State:
    """Return the state; ``is_late``: packets from before the last STOP may still arrive."""
    persona, tasks, authority = parts.persona, parts.tasks, parts.authority
    kind = authority.kind_of(parts.monitor.custom_mode, armed=parts.monitor.armed)
    return State(
        queue=_queue(tasks.paused),
        grip=GRIPS[parts.control.phase],
        work=_work(tasks),
        driver=_driver(parts, now=now),
        armed=parts.monitor.armed,
        may_be_armed=parts.monitor.may_be_armed or parts.armings.are_by_client(now=now),
        may_arm=authority.may_arm,
        waits=_waits(parts, now=now),
        is_led=kind in (ModeKind.MANUAL, ModeKind.OTHER),
        is_urgent=tasks.immediate is not None,
        is_idle=tasks.is_idle,
        is_stopping=pilot.guard.is_on,
        is_late=is_late,
        lingers=persona.is_held_before_places,
        has_failsafe=persona.has_loss_failsafe,
        heeds_stick=persona.heeds_throttle_stick,
        brakes=pilot.brakes_against_stick(now=now),
    )


def client_driving(parts: Parts, *, now: float) -> Hashable:
    """Return the client whose set-points the vehicle may still follow, or None."""
    return parts.authority.driver(within=parts.settings.watch.other_controller, now=now)


def _queue(paused: TaskReason) -> Queue:
    if not paused:
        return Queue.RUNS
    if paused is TaskReason.STOPPED:
        return Queue.STOPPED
    return Queue.TAKEN if paused in TAKEN else Queue.PAUSED


def _work(tasks: VehicleTasks) -> Work:
    active = tasks.active
    if active is None:
        return Work.NONE if tasks.is_empty else Work.WAITS
    if active.state in RUNNING:
        return Work.ENDS if active.state is TaskState.CANCELLING else Work.RUNS
    if active.reason in TAKEN:
        return Work.TAKEN
    return Work.LOST if tasks.executor.resumes_by_itself else Work.STANDS


def _driver(parts: Parts, *, now: float) -> Driver:
    if client_driving(parts, now=now) is not None:
        return Driver.CLIENT
    return Driver.OTHERS if parts.is_driven_by_others(now=now) else Driver.NOBODY


def _waits(parts: Parts, *, now: float) -> Waits:
    waits = NOTHING if parts.hold_before.holder(now=now) is None else Waits.GO_TO
    if parts.start.holder(now=now) is not None:
        waits |= Waits.START
    if parts.tasks.released is not None:
        waits |= Waits.RELEASE
    return waits | Waits.GRANT if parts.authority.has_any_grant else waits
