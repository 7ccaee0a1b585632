"""What the table of joint control orders, carried out on one vehicle: each effect by its name.

Nothing is decided here: a method for each ``Effect`` does the one thing that it is called after.
"""

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any

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


class Hands:
    """Carries out effects on one vehicle."""

    def __init__(self, parts: Parts, pilot: Pilot, step: Callable[[float], None]) -> None:
        """``step`` has the tasks say at a time what they demand, and does it."""
        self._parts = parts
        self._pilot = pilot
        self._step = step
        self._methods = {effect: getattr(self, effect.name.lower()) for effect in Effect}

    def __repr__(self) -> str:
        return f"Hands({self._pilot!r})"

    def carry_out(self, effect: Effect, word: Word, *, now: float) -> Any:
        """Carry out one effect; gives what it comes to, if anything. Rejection: DO was refused."""
        return self._methods[effect](word, now)

    # how it stands

    def brake(self, _word: Word, now: float) -> None:
        """Begin the stop ladder."""
        self._pilot.begin_stop(brakes=True, now=now)

    def hold_at_once(self, _word: Word, now: float) -> None:
        """Begin the stop ladder without set-points."""
        self._pilot.begin_stop(brakes=False, now=now)

    def let_go(self, _word: Word, now: float) -> None:
        """Zero and HOLD at once, HOLD until it shows."""
        self._pilot.let_go(now=now)

    def step(self, _word: Word, now: float) -> None:
        """Do what the tasks demand in this very step."""
        self._step(now)

    def watch(self, _word: Word, now: float) -> None:
        """See that it stands from here on."""
        self._pilot.watch(now=now)

    def zero(self, _word: Word, _now: float) -> None:
        """Send one zero."""
        self._parts.requests.send_zero()

    def zero_kept(self, _word: Word, _now: float) -> None:
        """Leave no velocity behind: a vehicle keeps the last one and drives off when armed."""
        if self._parts.control.is_streaming:
            self._parts.requests.send_zero()

    def zero_and_hold(self, _word: Word, _now: float) -> None:
        """Send both once; a failsafe's HOLD would be ended by a zero before it."""
        requests = self._parts.requests
        if self._parts.persona.has_loss_failsafe:
            requests.send_hold()
            requests.send_zero()
        else:
            requests.send_zero()
            requests.send_hold()

    def stay(self, _word: Word, now: float) -> None:
        """Ask for HOLD, which is shown already."""
        self._parts.control.ask_to_stay(now=now)
        self._parts.requests.flush(now=now)

    def lose(self, _word: Word, _now: float) -> None:
        """Send not one thing more."""
        self._parts.control.lose()
        self._parts.requests.end_performing()

    # what was asked for before

    def forget_go_to(self, _word: Word, _now: float) -> None:
        """A "go to" undoes no HOLD any more."""
        self._parts.hold_before.forget()

    def forget_start(self, _word: Word, _now: float) -> None:
        """No mission begins with the arming."""
        self._parts.forget_start()

    def forget_release(self, _word: Word, _now: float) -> None:
        """What was released and has not begun is held as before."""
        self._parts.tasks.forget_release()

    def revoke(self, _word: Word, _now: float) -> None:
        """A client that wants to drive has to ask again."""
        self._parts.authority.revoke()

    def drop_waiting(self, _word: Word, _now: float) -> None:
        """Send nothing of clients that waits for an answer to another, and might move it."""
        self._parts.requests.drop_what_waits()

    # the tasks

    def count(self, word: Word, now: float) -> None:
        """Count a halt."""
        self._parts.tasks.halt(word.reason, actor=word.actor, now=now)

    def pause(self, word: Word, now: float) -> Any:
        """Let task and queue stand; gives the task's id."""
        return self._parts.tasks.pause(TaskReason.OPERATOR, actor=word.actor, now=now)

    def pause_taken(self, word: Word, now: float) -> Any:
        """Let task and queue stand, because somebody else has the vehicle."""
        reason = word.reason if word.reason in TAKEN else TaskReason.TAKEOVER
        return self._parts.tasks.pause(reason, actor=self._parts.actor, now=now)

    def latch(self, word: Word, now: float) -> Any:
        """Kill what has the vehicle, and let nothing begin before a continue; gives its id."""
        return self._parts.tasks.stop(clear=word.clear, actor=word.actor, now=now)

    def hold_task(self, word: Word, now: float) -> None:
        """Set the task that has the vehicle aside until somebody decides."""
        self._parts.tasks.hold(word.reason, now=now)

    def do(self, word: Word, _now: float) -> Any:
        """Carry out what the word asks for."""
        return word.do()

    def wake(self, _word: Word, now: float) -> None:
        """Look at the tasks unless that is about to be done."""
        if not self._pilot.clock.is_running:
            self._step(now)

    # permissions, and what is told

    def withdraw_arming(self, _word: Word, now: float) -> None:
        """Arm it no more, also after a restart of ours."""
        self._parts.withdraw_arming(now=now)

    def restore_arming(self, _word: Word, now: float) -> None:
        """A person said that all is well."""
        self._parts.authority.restore_arming()
        self._parts.tasks.let_arm(may_be_armed=True, now=now)

    def linger(self, word: Word, now: float) -> None:
        """A "go to" may follow, and undo this HOLD."""
        has_paused = not self._parts.tasks.paused
        self._parts.hold_before.note(word.sender, has_paused=has_paused, now=now)

    def hand_over(self, _word: Word, _now: float) -> None:
        """A client goes on from our hand-back."""
        self._parts.control.hand_over()

    def keep_armed(self, _word: Word, _now: float) -> None:
        """It stays armed when we hand it back."""
        self._parts.control.keep_armed()

    def disarm_at_end(self, _word: Word, _now: float) -> None:
        """It is disarmed when we hand it back, whoever armed it."""
        self._parts.control.disarm_at_end()

    def note_others(self, _word: Word, now: float) -> None:
        """Somebody who is no client of ours drives just now."""
        self._parts.authority.note_other(now=now)

    def left(self, _word: Word, now: float) -> None:
        """A set-point leaves; that it comes late shows in the task."""
        self._parts.tasks.setpoint_left(now=now)

    def tell(self, word: Word, now: float) -> None:
        """Tell everybody."""
        self._parts.note(word.text, now=now)

    def tell_taken(self, word: Word, now: float) -> None:
        """Tell everybody what has taken it."""
        self._parts.note(f"taken over: {word.text}", now=now)

    def tell_stick(self, _word: Word, now: float) -> None:
        """Tell everybody what keeps the vehicle from driving."""
        self._parts.note("has a stick off centre: HOLD. Centre it", now=now)

    def tell_held(self, _word: Word, now: float) -> None:
        """Remind of a task that is held."""
        held = self._parts.tasks.held
        if held is not None:
            self._parts.note(f"has task {held.id} on hold: release it ({BUTTONS})", now=now)
