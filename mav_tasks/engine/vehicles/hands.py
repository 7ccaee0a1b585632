"""Carries out on one vehicle what the table of joint control orders.

Nothing is decided here. Each ``Effect`` has one case; ``control`` says what it is for.
"""

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, NamedTuple, assert_never

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
        case Effect.OUTDATE_ARMING:
            ours, armed = control.arming_asked_at, parts.monitor.armed
            parts.armings.outdate(ours=ours, armed=armed, now=now)
        case Effect.OUTDATE_OUR_ARMING:
            ours, armed = control.arming_asked_at, parts.monitor.armed
            parts.armings.outdate_ours(ours=ours, armed=armed, now=now)
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
