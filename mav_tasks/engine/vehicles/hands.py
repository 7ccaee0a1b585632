"""What the table of joint control orders, carried out on one vehicle: each effect by its name.

Nothing is decided here: a function for each ``Effect`` does the one thing that it is called after.
"""

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, NamedTuple

from mav_tasks.engine.vehicles.control import Effect
from mav_tasks.engine.vehicles.parts import Parts
from mav_tasks.engine.vehicles.pilot import Pilot
from mav_tasks.tasks.events import SERVER
from mav_tasks.tasks.lifecycle import TAKEN, TaskReason

#: a station's buttons for a held task
BUTTONS = '"Held: rest", "Held: again" or "Held: skip"'


@dataclass(frozen=True, slots=True)
class Word:
    """An event's particulars: whose it is and why, what is told of it, and what it asks for."""

    reason: TaskReason = TaskReason.OPERATOR
    actor: str = SERVER
    text: str = ""
    do: Callable[[], Any] = lambda: None  # Rejection: it is refused
    sender: Hashable = None  # of a HOLD that a "go to" may undo
    clear: bool = False  # of a STOP


class Reach(NamedTuple):
    """What effects work on."""

    parts: Parts
    pilot: Pilot
    step: Callable[[float], None]  # has the tasks say at a time what they demand, and does it


Method = Callable[[Reach, Word, float], Any]
_METHODS: dict[Effect, Method] = {}


def carry_out(effect: Effect, on: Reach, word: Word, *, now: float) -> Any:
    """Carry out one effect; gives what it comes to, if anything. Rejection: DO was refused."""
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
    """Zero and HOLD at once, HOLD until it shows."""
    on.pilot.let_go(now=now)


@_does(Effect.STEP)
def _step(on: Reach, _word: Word, now: float) -> None:
    """Do what the tasks demand in this very step."""
    on.step(now)


@_does(Effect.WATCH)
def _watch(on: Reach, _word: Word, now: float) -> None:
    """See that it stands from here on."""
    on.pilot.watch(now=now)


@_does(Effect.ZERO)
def _zero(on: Reach, _word: Word, _now: float) -> None:
    """Send one zero."""
    on.parts.requests.send_zero()


@_does(Effect.ZERO_KEPT)
def _zero_kept(on: Reach, _word: Word, _now: float) -> None:
    """Leave no velocity behind: a vehicle keeps the last one and drives off when armed."""
    if on.parts.control.is_streaming:
        on.parts.requests.send_zero()


@_does(Effect.ZERO_AND_HOLD)
def _zero_and_hold(on: Reach, _word: Word, _now: float) -> None:
    """Send both once; a failsafe's HOLD would be ended by a zero before it."""
    requests = on.parts.requests
    if on.parts.persona.has_loss_failsafe:
        requests.send_hold()
        requests.send_zero()
    else:
        requests.send_zero()
        requests.send_hold()


@_does(Effect.STAY)
def _stay(on: Reach, _word: Word, now: float) -> None:
    """Ask for HOLD, which is shown already."""
    on.parts.control.ask_to_stay(now=now)
    on.parts.requests.flush(now=now)


@_does(Effect.LOSE)
def _lose(on: Reach, _word: Word, _now: float) -> None:
    """Send not one thing more, whatever it was to stand for."""
    on.parts.tasks.end_halting()
    on.parts.control.lose()
    on.parts.requests.end_performing()


@_does(Effect.FORGET_GO_TO)
def _forget_go_to(on: Reach, _word: Word, _now: float) -> None:
    """A "go to" undoes no HOLD any more."""
    on.parts.hold_before.forget()


@_does(Effect.FORGET_START)
def _forget_start(on: Reach, _word: Word, _now: float) -> None:
    """No mission begins with the arming."""
    on.parts.forget_start()


@_does(Effect.FORGET_RELEASE)
def _forget_release(on: Reach, _word: Word, _now: float) -> None:
    """What was released and has not begun is held as before."""
    on.parts.tasks.forget_release()


@_does(Effect.REVOKE)
def _revoke(on: Reach, _word: Word, _now: float) -> None:
    """A client that wants to drive has to ask again."""
    on.parts.authority.revoke()


@_does(Effect.DROP_WAITING)
def _drop_waiting(on: Reach, _word: Word, _now: float) -> None:
    """Send nothing of clients that waits for an answer to another, and might move it."""
    on.parts.requests.drop_what_waits()


@_does(Effect.COUNT)
def _count(on: Reach, word: Word, now: float) -> None:
    """Count a halt."""
    on.parts.tasks.halt(word.reason, actor=word.actor, now=now)


@_does(Effect.PAUSE)
def _pause(on: Reach, word: Word, now: float) -> Any:
    """Let task and queue stand; gives the task's id."""
    return on.parts.tasks.pause(TaskReason.OPERATOR, actor=word.actor, now=now)


@_does(Effect.PAUSE_TAKEN)
def _pause_taken(on: Reach, word: Word, now: float) -> Any:
    """Let task and queue stand, because somebody else has the vehicle."""
    reason = word.reason if word.reason in TAKEN else TaskReason.TAKEOVER
    return on.parts.tasks.pause(reason, actor=on.parts.actor, now=now)


@_does(Effect.LATCH)
def _latch(on: Reach, word: Word, now: float) -> Any:
    """Kill what has the vehicle, and let nothing begin before a continue; gives its id."""
    return on.parts.tasks.stop(clear=word.clear, actor=word.actor, now=now)


@_does(Effect.HOLD_TASK)
def _hold_task(on: Reach, word: Word, now: float) -> None:
    """Set the task that has the vehicle aside until somebody decides."""
    on.parts.tasks.hold(word.reason, now=now)


@_does(Effect.DO)
def _do(_on: Reach, word: Word, _now: float) -> Any:
    """Carry out what the word asks for."""
    return word.do()


@_does(Effect.WAKE)
def _wake(on: Reach, _word: Word, now: float) -> None:
    """Look at the tasks unless that is about to be done."""
    if not on.pilot.clock.is_running:
        on.step(now)


@_does(Effect.WITHDRAW_ARMING)
def _withdraw_arming(on: Reach, _word: Word, now: float) -> None:
    """Arm it no more, also after a restart of ours."""
    on.parts.withdraw_arming(now=now)


@_does(Effect.OUTDATE_ARMING)
def _outdate_arming(on: Reach, _word: Word, now: float) -> None:
    """What was to arm it before counts no more, also where the net still has it."""
    ours, armed = on.parts.control.arming_asked_at, on.parts.monitor.armed
    on.parts.armings.outdate(ours=ours, armed=armed, now=now)


@_does(Effect.OUTDATE_OUR_ARMING)
def _outdate_our_arming(on: Reach, _word: Word, now: float) -> None:
    """What we wanted to arm it for is over."""
    ours, armed = on.parts.control.arming_asked_at, on.parts.monitor.armed
    on.parts.armings.outdate_ours(ours=ours, armed=armed, now=now)


@_does(Effect.EXPECT_DISARMED)
def _expect_disarmed(on: Reach, _word: Word, _now: float) -> None:
    """No task takes it by an arming that it shows until it has shown the disarming."""
    on.parts.armings.expect_disarmed(armed=on.parts.monitor.armed)


@_does(Effect.DISARM)
def _disarm(on: Reach, _word: Word, now: float) -> None:
    """Ask for disarming, whoever armed it, until it is answered."""
    on.parts.control.disarm_now(now=now)
    on.parts.requests.flush(now=now)


@_does(Effect.RESTORE_ARMING)
def _restore_arming(on: Reach, _word: Word, now: float) -> None:
    """A person said that all is well."""
    on.parts.authority.restore_arming()
    on.parts.armings.forget_halts()
    on.parts.tasks.terms.let_arm(may_be_armed=True, now=now)


@_does(Effect.LINGER)
def _linger(on: Reach, word: Word, now: float) -> None:
    """A "go to" may follow, and undo this HOLD."""
    has_paused = not on.parts.tasks.paused
    on.parts.hold_before.note(word.sender, has_paused=has_paused, now=now)


@_does(Effect.HAND_OVER)
def _hand_over(on: Reach, _word: Word, _now: float) -> None:
    """A client goes on from our hand-back."""
    on.parts.control.hand_over()


@_does(Effect.KEEP_ARMED)
def _keep_armed(on: Reach, _word: Word, _now: float) -> None:
    """It stays armed when we hand it back."""
    on.parts.control.keep_armed()


@_does(Effect.DISARM_AT_END)
def _disarm_at_end(on: Reach, _word: Word, _now: float) -> None:
    """It is disarmed when we hand it back, whoever armed it."""
    on.parts.control.disarm_at_end()


@_does(Effect.NOTE_OTHERS)
def _note_others(on: Reach, _word: Word, now: float) -> None:
    """Somebody who is no client of ours drives just now."""
    on.parts.authority.note_other(now=now)


@_does(Effect.LEFT)
def _left(on: Reach, _word: Word, now: float) -> None:
    """A set-point leaves; that it comes late shows in the task."""
    on.parts.tasks.setpoint_left(now=now)


@_does(Effect.TELL)
def _tell(on: Reach, word: Word, now: float) -> None:
    """Tell everybody."""
    on.parts.note(word.text, now=now)


@_does(Effect.TELL_TAKEN)
def _tell_taken(on: Reach, word: Word, now: float) -> None:
    """Tell everybody what has taken it."""
    on.parts.note(f"taken over: {word.text}", now=now)


@_does(Effect.TELL_STICK)
def _tell_stick(on: Reach, _word: Word, now: float) -> None:
    """Tell everybody what keeps the vehicle from driving."""
    on.parts.note("has a stick off centre: HOLD. Centre it", now=now)


@_does(Effect.TELL_HELD)
def _tell_held(on: Reach, _word: Word, now: float) -> None:
    """Remind of a task that is held."""
    held = on.parts.tasks.held
    if held is not None:
        on.parts.note(f"has task {held.id} on hold: release it ({BUTTONS})", now=now)
