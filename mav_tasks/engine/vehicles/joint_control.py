"""Joint control of one vehicle: passes each request and event through the table of control once.

STOP comes first, then what somebody else did to the vehicle, then what we want. A vehicle that is
not ours gets no set-point at all. ``state_of`` says in which state it is; ``carry_out`` has one
case for each effect, and decides nothing.
"""

from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from functools import partial
from math import inf
from typing import Any, NamedTuple, assert_never

from mav_tasks.basics.errors import Rejection
from mav_tasks.engine.services.orders import Phase
from mav_tasks.engine.vehicles.authority import SHOWN_LATE
from mav_tasks.engine.vehicles.control import (
    NOTHING,
    Driver,
    Effect,
    Event,
    Grip,
    Queue,
    State,
    Waits,
    Work,
    effects_of,
)
from mav_tasks.engine.vehicles.parts import HoldBefore, Parts
from mav_tasks.engine.vehicles.pilot import Pilot
from mav_tasks.tasks.events import SERVER
from mav_tasks.tasks.lifecycle import CONTINUE_FIRST, RUNNING, TAKEN, TaskReason, TaskState
from mav_tasks.tasks.task import Draft, Task, TaskId
from mav_tasks.tasks.vehicle_tasks import VehicleTasks
from mav_tasks.tasks.view import ModeKind, VehicleView

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


#: the buttons of a ground station for a held task
BUTTONS = '"Held: remainder", "Held: again" or "Held: skip"'


@dataclass(frozen=True, slots=True)
class Word:
    """An event's particulars: reason, actor, the text to report, and the request itself."""

    reason: TaskReason = TaskReason.OPERATOR
    actor: str = SERVER
    text: str = ""
    do: Callable[[], Any] = lambda: None  # raises Rejection if refused
    sender: Hashable = None  # sender of a HOLD that a "go to" may undo
    pauses: bool = False  # of such a HOLD: the queue ran
    clear: bool = False  # of a STOP: also cancel all other tasks


class Reach(NamedTuple):
    """What effects work on."""

    parts: Parts
    pilot: Pilot
    step: Callable[[float], None]  # runs the tasks, and carries out their demand, at a time


def carry_out(effect: Effect, on: Reach, word: Word, *, now: float) -> Any:
    """Carry out one effect and return its result. Raise Rejection if DO was refused."""
    parts, pilot, step = on
    tasks, control, requests = parts.tasks, parts.control, parts.requests
    match effect:
        # how it is stopped
        case Effect.BRAKE:
            pilot.begin_stop(brakes=True, now=now)
        case Effect.HOLD_AT_ONCE:
            pilot.begin_stop(brakes=False, now=now)
        case Effect.LET_GO:
            pilot.let_go(now=now)
        case Effect.STEP:
            step(now)
        case Effect.WATCH:
            pilot.watch(now=now)
        case Effect.ZERO:
            requests.send_zero()
        case Effect.ZERO_KEPT:
            if control.is_streaming:
                requests.send_zero()
        case Effect.ZERO_AND_HOLD:
            requests.send_zero_and_hold()
        case Effect.STAY:
            control.ask_to_stay(now=now)
            requests.flush(now=now)
        case Effect.REGAIN:
            pilot.regain(now=now)
        case Effect.LOSE:
            tasks.stopping_after_kill = False
            control.lose()
            requests.end_performing()
        # earlier requests must not take effect later
        case Effect.FORGET_GO_TO:
            parts.forget_go_to()
        case Effect.FORGET_START:
            parts.forget_start()
        case Effect.FORGET_RELEASE:
            tasks.release_permit.end()
        case Effect.REVOKE:
            parts.authority.revoke()
        case Effect.OUTDATE:
            tasks.halts.term += 1
        # the tasks
        case Effect.COUNT:
            tasks.halt(word.reason, actor=word.actor, now=now)
        case Effect.PAUSE:
            return tasks.pause(TaskReason.OPERATOR, actor=word.actor, now=now)
        case Effect.PAUSE_TAKEN:
            reason = word.reason if word.reason in TAKEN else TaskReason.TAKEOVER
            return tasks.pause(reason, actor=word.actor, now=now)
        case Effect.LATCH:
            return tasks.stop(clear=word.clear, actor=word.actor, now=now)
        case Effect.HOLD_TASK:
            tasks.hold(word.reason, now=now)
        case Effect.DO:
            return word.do()
        case Effect.WAKE:
            if not pilot.clock.is_running:  # otherwise a tick is about to run them
                step(now)
        # permissions and reports
        case Effect.WITHDRAW_ARMING:
            parts.withdraw_arming(now=now)
        case Effect.RESTORE_ARMING:
            parts.authority.restore_arming()
            parts.armings.forget_halts()
            tasks.let_arm(may_be_armed=True, now=now)
        case Effect.OUTDATE_ARMING | Effect.OUTDATE_OUR_ARMING:
            parts.armings.outdate(
                ours=control.arming_asked_at,
                armed=parts.monitor.armed,
                only_ours=effect is Effect.OUTDATE_OUR_ARMING,
                now=now,
            )
        case Effect.EXPECT_DISARMED:
            parts.armings.is_to_be_disarmed = parts.monitor.armed
        case Effect.DISARM:
            control.disarm_now(now=now)
            requests.flush(now=now)
        case Effect.LINGER:
            parts.held_by(word.sender, has_paused=word.pauses, now=now)
        case Effect.HAND_OVER:
            control.hand_over()
        case Effect.KEEP_ARMED:
            control.keep_armed()
        case Effect.DISARM_AT_END:
            control.disarm_at_end()
        case Effect.NOTE_OTHERS:
            parts.authority.other_at = now
        case Effect.LEFT:
            tasks.executor.setpoint_left(now=now)
        case Effect.TELL:
            parts.note(word.text, now=now)
        case Effect.TELL_TAKEN:
            parts.note(f"taken over: {word.text}", now=now)
        case Effect.TELL_STICK:
            parts.note("has a stick off centre: HOLD is set. Centre it", now=now)
        case Effect.TELL_HELD:
            if held := tasks.held:
                parts.note(f"keeps task {held.id} on hold: press {BUTTONS}", now=now)
        case _:
            assert_never(effect)
    return None


R = TaskReason


class JointControl:
    """The entry point for each request to one vehicle and each event seen on it."""

    def __init__(self, parts: Parts, pilot: Pilot, view: Callable[[float], VehicleView]) -> None:
        """``view`` returns a snapshot of the vehicle at a time."""
        self._parts = parts
        self._pilot = pilot
        self._view = view
        self._reach = Reach(parts, pilot, self.step)
        self._stops_task = False  # whether the shutdown of the server interrupted a task
        self.stopped_at = -inf  #: s, time of the last STOP

    def __repr__(self) -> str:
        return f"JointControl({self._parts.control!r}, {self._parts.tasks!r})"

    def on(self, event: Event, word: Word, *, now: float) -> TaskId | None:
        """Carry out the table's effects for an event; return the task that it was about, if any.

        Raise Rejection if the request is refused. The effects before the refusal remain in force.
        """
        self.decide(now=now)
        result: TaskId | None = None
        for effect in effects_of(event, self.state(now=now)):
            if isinstance(effect, Event):
                found = self.on(effect, word, now=now)
            else:
                found = carry_out(effect, self._reach, word, now=now)
            result = result if found is None else found
        return result

    def decide(self, *, now: float) -> None:
        """Take what changed for a person's doing: the vehicle's clock has shown no restart."""
        undecided, self._parts.undecided = self._parts.undecided, []
        for by_person in undecided:
            by_person(now)

    def step(self, now: float) -> None:
        """Run the tasks, carry out their demand, and handle the events that this reveals."""
        for event, reason, text in self._pilot.follow(now=now):
            self.on(event, Word(reason, text=text), now=now)
        self._pilot.send(now=now)

    def wake(self, *, now: float) -> None:
        """Run the tasks, because one may be ready, unless a tick is about to do so."""
        if not self._pilot.clock.is_running:
            self.step(now)

    def state(self, *, now: float) -> State:
        """Return the state that decides about the next event."""
        is_late = now - self.stopped_at <= SHOWN_LATE
        return state_of(self._parts, self._pilot, is_late=is_late, now=now)

    # requests that halt the vehicle

    def stop(self, *, clear: bool, actor: str, now: float) -> TaskId | None:
        """STOP: send zero and HOLD in this very step. Return the id of the killed task."""
        self.stopped_at = now
        return self.on(Event.STOP, Word(R.STOPPED, actor, clear=clear), now=now)

    def hold(self, *, sender: Hashable, actor: str, now: float) -> TaskId | None:
        """Handle a client's HOLD. Return the id of the task that it pauses."""
        word = Word(actor=actor, sender=sender, pauses=not self._parts.tasks.paused)
        return self.on(Event.HOLD, word, now=now)

    def pause(self, *, actor: str, now: float) -> TaskId | None:
        """Pause the queue and the active task, if there is one. Return its id."""
        return self.on(Event.PAUSE, Word(actor=actor), now=now)

    def disarm(self, *, by_force: bool, actor: str, now: float) -> None:
        """Handle a client's disarming: only a newer request arms the vehicle again.

        ``by_force``: it is the emergency stop of a ground station.
        """
        do = partial(self._parts.tasks.end_what_drives, actor=actor, now=now)
        event = Event.EMERGENCY_STOP if by_force else Event.DISARM
        self.on(event, Word(R.DISARMED, actor, do=do), now=now)

    def sticks_moved(self, *, actor: str, now: float) -> None:
        """Let go: a client sends manual control input."""
        word = Word(R.TAKEOVER, actor, "manual control")
        self.on(Event.DRIVEN_BY_HAND, word, now=now)

    def check_late(self, *, now: float) -> None:
        """Stop a vehicle that drove on during a stall of the server, and hold its task.

        What arrived meanwhile looks fresh but is not, so it must not steer anything.
        """
        if self._pilot.is_late(now=now):
            self.on(Event.LATE, Word(R.LATE), now=now)

    def shut_down(self, *, now: float) -> None:
        """Shut down: pause the active task, stop what we drive, and start no more tasks."""
        self._pilot.close()
        active = self._parts.tasks.active
        self._stops_task = active is not None and active.state in RUNNING
        self.on(Event.CLOSE, Word(), now=now)

    def leave(self, *, now: float) -> None:
        """Stop what we drive: this gateway leaves its fleet, and another one goes on with it."""
        active = self._parts.tasks.active
        self._stops_task = active is not None and active.state in RUNNING
        self.on(Event.LEASE_ENDS, Word(), now=now)
        self._pilot.close()
        self.on(Event.LEAVE, Word(), now=now)

    def note_rest(self, *, now: float) -> None:
        """Store where the interrupted task has come to rest: the server ends now."""
        if self._stops_task:
            self._parts.tasks.rest(self._view(now), now=now)

    # cancelling

    def cancel(
        self,
        task: Task,
        *,
        kill: bool,
        actor: str,
        now: float,
        reason: TaskReason = R.CANCELLED,
    ) -> None:
        """Cancel a task; if it is the active one, zeros leave in this very step."""
        tasks = self._parts.tasks
        active = tasks.active
        event = Event.CANCEL if active is not None and active.id == task.id else Event.UNQUEUE
        do = partial(tasks.cancel, task, kill=kill, reason=reason, actor=actor, now=now)
        self.on(event, Word(reason, actor, do=do), now=now)

    def skip(self, task: Task, *, actor: str, now: float) -> None:
        """End a held task."""
        cancel = self._parts.tasks.cancel
        do = partial(cancel, task, kill=False, reason=R.SKIPPED, actor=actor, now=now)
        self.on(Event.SKIP, Word(R.SKIPPED, actor, do=do), now=now)

    def clear(self, *, begun_too: bool, actor: str, now: float) -> None:
        """Cancel the waiting tasks; with ``begun_too`` also suspended and active ones."""
        do = partial(self._parts.tasks.clear, begun_too=begun_too, actor=actor, now=now)
        event = Event.CLEAR if begun_too else Event.CLEAR_WAITING
        self.on(event, Word(R.CLEARED, actor, do=do), now=now)

    # requests that let the vehicle go

    def proceed(self, *, actor: str, now: float) -> TaskId | None:
        """Release STOP, takeover and pause, and allow arming again. A held task stays held.

        Return the id of the task that resumes. Raise Rejection if the active task could not take
        the vehicle now.
        """
        authority = self._parts.authority
        may_arm = authority.may_arm_again

        def go_on() -> TaskId | None:
            seen = replace(self._view(now), may_arm=may_arm)
            allows = may_arm and not authority.may_arm
            return self._parts.tasks.proceed(seen, allows=allows, actor=actor, now=now)

        return self.on(Event.CONTINUE, Word(R.NONE, actor, do=go_on), now=now)

    def go_on(self, *, actor: str, now: float) -> None:
        """End a pause like ``proceed``, but do not allow arming again: nobody asked for that.

        A vehicle in somebody's mode goes to HOLD, as an autopilot would end that mode.
        """

        def go_on() -> None:
            self._parts.tasks.proceed(self._as_in_hold(now), actor=actor, now=now)

        self.on(Event.GO_ON, Word(R.NONE, actor, do=go_on), now=now)

    def go_to_follows(self, held: HoldBefore, *, actor: str, now: float) -> None:
        """Undo the pause by the HOLD just before a client's "go to", which is durable now."""
        is_still = self._parts.undone.holder(now=now) is held
        if not is_still or self._parts.tasks.paused is not R.OPERATOR:
            return
        try:
            self.go_on(actor=actor, now=now)
        except Rejection as refusal:
            self._parts.note(f"stays paused: {refusal.text}", now=now)

    def release(
        self, task: Task, *, again: bool, may_continue: bool, actor: str, now: float
    ) -> None:
        """Let a held task resume. Raise Rejection if it could not take the vehicle now.

        After a restart of the vehicle it restores the permission to arm, if the person may give
        that (``may_continue``). A vehicle that somebody disarmed stays so until a continue.
        """
        authority = self._parts.authority
        restores = may_continue and authority.is_withdrawn_by_restart
        seen = self._view(now)
        if restores:
            seen = replace(seen, may_arm=authority.may_arm_again)
        release = self._parts.tasks.release
        do = partial(
            release, task, again=again, may_continue=may_continue, seen=seen, actor=actor, now=now
        )
        self.on(Event.RESTORE if restores else Event.RELEASE, Word(R.NONE, actor, do=do), now=now)

    def run_now(self, draft: Draft, *, actor: str, now: float) -> Task:
        """Submit a task that runs before all others, at once, from whatever mode.

        Raise Rejection if refused, also while a person drives.
        """
        self._parts.check_not_manual(now=now)

        def take_in() -> TaskId:
            return self._parts.tasks.run_now(draft, self._as_in_hold(now), actor=actor, now=now)

        task_id = self.on(Event.RUN_NOW, Word(R.NONE, actor, do=take_in), now=now)
        assert task_id is not None, "it was taken in"
        return self._parts.registry[task_id]

    def give_way_to(self, task: Task, *, actor: str, now: float) -> None:
        """Run a mission at once, from whatever mode; all others wait until the queue resumes."""
        do = partial(self._parts.tasks.give_way_to, task, actor=actor, now=now)
        self.on(Event.RUN_NOW, Word(R.NONE, actor, do=do), now=now)

    def client_asks_mode(self, mode: int, client: Hashable, *, now: float) -> None:
        """Note that a client's mode request goes to the vehicle through us.

        Our own mode then counts as set by us. Another mode is a takeover once a heartbeat shows it;
        until then, no request of ours may work against it.
        """
        parts = self._parts
        authority, persona = parts.authority, parts.persona
        present_mode = parts.monitor.custom_mode
        # The vehicle enters that mode only while setpoints stream, and has not received any yet.
        # They pass once it is armed, which no heartbeat may have shown yet.
        streams = persona.arms_in_hold and authority.streams(client, now=now)
        if mode != persona.control_mode:
            event = Event.ASK_OTHER_MODE
        else:
            event = Event.ASK_OUR_MODE_STREAMING if streams else Event.ASK_OUR_MODE
        do = partial(authority.client_asks, mode, client, present_mode=present_mode, now=now)
        text = f"a client asked for {persona.mode_name(mode)}"
        self.on(event, Word(R.TAKEOVER, parts.actor, text, do=do), now=now)

    def arm(self, *, now: float) -> None:
        """Handle a client's request to arm, which goes to the vehicle through us."""
        self.on(Event.ARM, Word(do=partial(self._parts.armings.client_arms, now=now)), now=now)

    # the end of a client's own driving

    def end_driving_of(self, client: Hashable, *, now: float) -> None:
        """End a client's own setpoints, because it asks for a return, a "go to" or a mission.

        The vehicle stops, so that neither the client's last velocity nor a failsafe for lost
        setpoints acts before the new request.
        """
        if client is not None and client_driving(self._parts, now=now) == client:
            self.on(Event.DRIVING_ENDS, Word(), now=now)

    def stand_down(self, client: Hashable, *, now: float) -> None:
        """Disarm the vehicle, which a client has landed, once no task is left to drive.

        Raise Rejection under STOP, and while a person drives.
        """
        if self._parts.tasks.is_stopped:
            raise Rejection(R.STOPPED, CONTINUE_FIRST)
        self._parts.check_not_manual(now=now)
        self.end_driving_of(client, now=now)
        self.on(Event.LANDED, Word(), now=now)

    def _as_in_hold(self, now: float) -> VehicleView:
        """Return the vehicle as it will be when it has left somebody's mode."""
        seen = self._view(now)
        return seen if seen.mode is ModeKind.OURS else replace(seen, mode=ModeKind.HOLD)
