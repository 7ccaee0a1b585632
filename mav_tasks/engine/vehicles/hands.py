"""Carries out on one vehicle what the table of joint control orders.

Nothing is decided here. Each ``Effect`` has one function of the same name.
"""

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, NamedTuple

from mav_tasks.engine.vehicles.control import Effect
from mav_tasks.engine.vehicles.parts import Parts
from mav_tasks.engine.vehicles.pilot import Pilot
from mav_tasks.tasks.events import SERVER
from mav_tasks.tasks.lifecycle import TAKEN, TaskReason

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
    clear: bool = False  # of a STOP: also cancel all other tasks


class Reach(NamedTuple):
    """What effects work on."""

    parts: Parts
    pilot: Pilot
    step: Callable[[float], None]  # runs the tasks, and carries out their demand, at a time


Method = Callable[[Reach, Word, float], Any]
_METHODS: dict[Effect, Method] = {}


def carry_out(effect: Effect, on: Reach, word: Word, *, now: float) -> Any:
    """Carry out one effect and return its result. Raise Rejection if DO was refused."""
    return _METHODS[effect](on, word, now)


def _does(effect: Effect) -> Callable[[Method], Method]:
    def note(method: Method) -> Method:
        _METHODS[effect] = method
        return method

    return note


@_does(Effect.BRAKE)
def _brake(on: Reach, _word: Word, now: float) -> None:
    """Begin the stop ladder."""
    on.pilot.begin_stop(brakes=True, now=now)


@_does(Effect.HOLD_AT_ONCE)
def _hold_at_once(on: Reach, _word: Word, now: float) -> None:
    """Begin the stop ladder without set-points."""
    on.pilot.begin_stop(brakes=False, now=now)


@_does(Effect.LET_GO)
def _let_go(on: Reach, _word: Word, now: float) -> None:
    """Send zero and HOLD at once, and repeat HOLD until it shows."""
    on.pilot.let_go(now=now)


@_does(Effect.STEP)
def _step(on: Reach, _word: Word, now: float) -> None:
    """Run the tasks in this very step."""
    on.step(now)


@_does(Effect.WATCH)
def _watch(on: Reach, _word: Word, now: float) -> None:
    """Run the stop ladder from here on."""
    on.pilot.watch(now=now)


@_does(Effect.ZERO)
def _zero(on: Reach, _word: Word, _now: float) -> None:
    """Send one zero."""
    on.parts.requests.send_zero()


@_does(Effect.ZERO_KEPT)
def _zero_kept(on: Reach, _word: Word, _now: float) -> None:
    """Send a zero: a vehicle keeps its last velocity and would drive off when armed."""
    if on.parts.control.is_streaming:
        on.parts.requests.send_zero()


@_does(Effect.ZERO_AND_HOLD)
def _zero_and_hold(on: Reach, _word: Word, _now: float) -> None:
    """Send both once. A zero before HOLD would end the HOLD of a failsafe."""
    requests = on.parts.requests
    if on.parts.persona.has_loss_failsafe:
        requests.send_hold()
        requests.send_zero()
    else:
        requests.send_zero()
        requests.send_hold()


@_does(Effect.STAY)
def _stay(on: Reach, _word: Word, now: float) -> None:
    """Ask for HOLD although the vehicle shows it."""
    on.parts.control.ask_to_stay(now=now)
    on.parts.requests.flush(now=now)


@_does(Effect.LOSE)
def _lose(on: Reach, _word: Word, _now: float) -> None:
    """Send nothing more, not even to stop the vehicle."""
    on.parts.tasks.end_halting()
    on.parts.control.lose()
    on.parts.requests.end_performing()


@_does(Effect.FORGET_GO_TO)
def _forget_go_to(on: Reach, _word: Word, _now: float) -> None:
    """Forget that a "go to" may undo a HOLD."""
    on.parts.hold_before.forget()


@_does(Effect.FORGET_START)
def _forget_start(on: Reach, _word: Word, _now: float) -> None:
    """Forget that a mission starts with the arming."""
    on.parts.forget_start()


@_does(Effect.FORGET_RELEASE)
def _forget_release(on: Reach, _word: Word, _now: float) -> None:
    """Put a released task that has not started back on hold."""
    on.parts.tasks.forget_release()


@_does(Effect.REVOKE)
def _revoke(on: Reach, _word: Word, _now: float) -> None:
    """Revoke the grants: a client that wants to drive must ask again."""
    on.parts.authority.revoke()


@_does(Effect.DROP_WAITING)
def _drop_waiting(on: Reach, _word: Word, _now: float) -> None:
    """Drop clients' commands that wait behind an unanswered one and might move it."""
    on.parts.requests.drop_what_waits()


@_does(Effect.COUNT)
def _count(on: Reach, word: Word, now: float) -> None:
    """Count a halt."""
    on.parts.tasks.halt(word.reason, actor=word.actor, now=now)


@_does(Effect.PAUSE)
def _pause(on: Reach, word: Word, now: float) -> Any:
    """Pause the queue and the active task; return the task's id."""
    return on.parts.tasks.pause(TaskReason.OPERATOR, actor=word.actor, now=now)


@_does(Effect.PAUSE_TAKEN)
def _pause_taken(on: Reach, word: Word, now: float) -> Any:
    """Pause queue and task because somebody else has the vehicle; return the task's id."""
    reason = word.reason if word.reason in TAKEN else TaskReason.TAKEOVER
    return on.parts.tasks.pause(reason, actor=on.parts.actor, now=now)


@_does(Effect.LATCH)
def _latch(on: Reach, word: Word, now: float) -> Any:
    """Kill the active task, and start none before a continue; return its id."""
    return on.parts.tasks.stop(clear=word.clear, actor=word.actor, now=now)


@_does(Effect.HOLD_TASK)
def _hold_task(on: Reach, word: Word, now: float) -> None:
    """Put the active task on hold until somebody decides."""
    on.parts.tasks.hold(word.reason, now=now)


@_does(Effect.DO)
def _do(_on: Reach, word: Word, _now: float) -> Any:
    """Carry out the request itself."""
    return word.do()


@_does(Effect.WAKE)
def _wake(on: Reach, _word: Word, now: float) -> None:
    """Run the tasks, unless a tick is about to do so."""
    if not on.pilot.clock.is_running:
        on.step(now)


@_does(Effect.WITHDRAW_ARMING)
def _withdraw_arming(on: Reach, _word: Word, now: float) -> None:
    """Withdraw the permission to arm, also across a restart of the server."""
    on.parts.withdraw_arming(now=now)


@_does(Effect.OUTDATE_ARMING)
def _outdate_arming(on: Reach, _word: Word, now: float) -> None:
    """Outdate all earlier requests to arm it, even if the network still holds one."""
    ours, armed = on.parts.control.arming_asked_at, on.parts.monitor.armed
    on.parts.armings.outdate(ours=ours, armed=armed, now=now)


@_does(Effect.OUTDATE_OUR_ARMING)
def _outdate_our_arming(on: Reach, _word: Word, now: float) -> None:
    """Outdate our own requests to arm it: we need it armed no more."""
    ours, armed = on.parts.control.arming_asked_at, on.parts.monitor.armed
    on.parts.armings.outdate_ours(ours=ours, armed=armed, now=now)


@_does(Effect.EXPECT_DISARMED)
def _expect_disarmed(on: Reach, _word: Word, _now: float) -> None:
    """Let no task use the present armed state until the vehicle has shown disarmed."""
    on.parts.armings.expect_disarmed(armed=on.parts.monitor.armed)


@_does(Effect.DISARM)
def _disarm(on: Reach, _word: Word, now: float) -> None:
    """Ask for disarming until it is answered, whoever armed the vehicle."""
    on.parts.control.disarm_now(now=now)
    on.parts.requests.flush(now=now)


@_does(Effect.RESTORE_ARMING)
def _restore_arming(on: Reach, _word: Word, now: float) -> None:
    """Allow arming again, as a person asked."""
    on.parts.authority.restore_arming()
    on.parts.armings.forget_halts()
    on.parts.tasks.terms.let_arm(may_be_armed=True, now=now)


@_does(Effect.LINGER)
def _linger(on: Reach, word: Word, now: float) -> None:
    """Note that a "go to" may follow and undo this HOLD."""
    has_paused = not on.parts.tasks.paused
    on.parts.hold_before.note(word.sender, has_paused=has_paused, now=now)


@_does(Effect.HAND_OVER)
def _hand_over(on: Reach, _word: Word, _now: float) -> None:
    """Let a client take the vehicle while we hand it back."""
    on.parts.control.hand_over()


@_does(Effect.KEEP_ARMED)
def _keep_armed(on: Reach, _word: Word, _now: float) -> None:
    """Leave it armed when we hand it back."""
    on.parts.control.keep_armed()


@_does(Effect.DISARM_AT_END)
def _disarm_at_end(on: Reach, _word: Word, _now: float) -> None:
    """Disarm it when we hand it back, whoever armed it."""
    on.parts.control.disarm_at_end()


@_does(Effect.NOTE_OTHERS)
def _note_others(on: Reach, _word: Word, now: float) -> None:
    """Note that somebody who is not our client is driving."""
    on.parts.authority.note_other(now=now)


@_does(Effect.LEFT)
def _left(on: Reach, _word: Word, now: float) -> None:
    """Note that a set-point leaves; its lateness shows in the task."""
    on.parts.tasks.setpoint_left(now=now)


@_does(Effect.TELL)
def _tell(on: Reach, word: Word, now: float) -> None:
    """Report the text."""
    on.parts.note(word.text, now=now)


@_does(Effect.TELL_TAKEN)
def _tell_taken(on: Reach, word: Word, now: float) -> None:
    """Report what has taken the vehicle."""
    on.parts.note(f"taken over: {word.text}", now=now)


@_does(Effect.TELL_STICK)
def _tell_stick(on: Reach, _word: Word, now: float) -> None:
    """Report that a stick keeps the vehicle from driving."""
    on.parts.note("has a stick off centre: HOLD is set. Centre it", now=now)


@_does(Effect.TELL_HELD)
def _tell_held(on: Reach, _word: Word, now: float) -> None:
    """Remind of a held task."""
    held = on.parts.tasks.held
    if held is not None:
        on.parts.note(f"waits for held task {held.id}: press {BUTTONS}", now=now)
