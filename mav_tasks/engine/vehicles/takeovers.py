"""Detects what others have done to a vehicle: a mode, arming, a stick, a restart.

A change may be our own doing, a client's through us, a person's at the vehicle, or a failsafe's.
This module finds out which; the control table decides what follows.
"""

from collections.abc import Callable
from functools import partial
from math import inf

from mav_tasks.engine.vehicles.authority import ANY_MODE, SHOWN_LATE, Before
from mav_tasks.engine.vehicles.control import Event
from mav_tasks.engine.vehicles.joint_control import BUTTONS, JointControl, Word
from mav_tasks.engine.vehicles.motion_guard import NEARLY_STANDS
from mav_tasks.engine.vehicles.own_failsafes import News
from mav_tasks.engine.vehicles.parts import Parts
from mav_tasks.tasks.halts import LastHalt
from mav_tasks.tasks.lifecycle import TAKEN, TaskReason

R = TaskReason
#: s after which a mode change is a person's if the clock has not been heard
UNDECIDED = 5.0


class Takeovers:
    """Detects who has done what to one vehicle."""

    def __init__(self, parts: Parts, joint: JointControl) -> None:
        self._parts = parts
        self._joint = joint
        self._may_show_until = -inf  # s, effects of packets sent before an earlier run's last halt
        self._shows_restart = False  # a restart was seen, and the next heartbeat will show it, too
        self._others_drive = False  # it moved in a mode in which we did not drive it
        self._undecided_at = -inf  # s, when it showed the mode that may come from a restart

    def __repr__(self) -> str:
        return f"Takeovers({self._joint!r})"

    def come_back(self, *, was_driven: bool, halt: LastHalt | None, now: float) -> None:
        """Handle a vehicle of an earlier run: stop it if that run left it driving.

        Stop it also if that run ended just after a ``halt``, because HOLD may not have arrived.

        If somebody else had taken it over or disarmed it, we do not arm it before a person
        continues.
        """
        parts = self._parts
        mode, persona = parts.monitor.custom_mode, parts.persona
        is_taken = parts.tasks.paused in TAKEN
        if is_taken or not parts.tasks.may_be_armed:
            parts.withdraw_arming(now=now)
        # It is in HOLD because set-points were lost, and would follow the next one. If somebody had
        # taken it, our set-points had ended before.
        is_lost = persona.has_loss_failsafe and mode == persona.hold_mode and not is_taken
        words = (
            f"is in {persona.mode_name(mode)} (failsafe or a person): mode not changed."
            " Set HOLD to stop it, then release its task"
        )
        if halt is not None:
            self._may_show_until = halt.at + SHOWN_LATE
            if halt.reason is R.STOPPED:
                self._joint.stopped_at = halt.at
            if halt.reason in (R.STOPPED, R.DISARMED):
                armed = parts.monitor.armed
                parts.armings.outdate_earlier(armed=armed, until=self._may_show_until, now=now)
        is_disarmed = halt is not None and halt.reason is R.DISARMED
        if (was_driven or halt is not None) and not is_disarmed and self._may_drive_on(now=now):
            event = Event.COME_BACK_DRIVING
        elif halt is not None and parts.monitor.armed and not parts.is_manual:
            event = Event.COME_BACK_HALTED
        elif not was_driven:
            event = Event.COME_BACK
        elif is_lost or mode == persona.control_mode:
            event = Event.COME_BACK_DRIVEN
        else:
            event = Event.COME_BACK_LED_AWAY
        self._joint.on(event, Word(text=words), now=now)
        is_parked = mode == persona.hold_mode and parts.monitor.armed
        if is_parked and not parts.tasks.may_be_armed:  # by somebody before this run
            self._taken(Event.PARKED, "", now=now)

    def _may_drive_on(self, *, now: float) -> bool:
        """Return whether set-points of an earlier run may still drive a vehicle that is met now.

        A gateway that did not have it gets few positions: an ArduPilot streams on each link only
        what was requested there. One that stands by its heading cannot be braked without it.
        """
        parts, motion = self._parts, self._parts.where.latest()
        is_ours = parts.monitor.armed and parts.monitor.custom_mode == parts.persona.control_mode
        if not is_ours or parts.tasks.paused in TAKEN:
            return False
        if motion is None or now - motion.at > parts.settings.watch.motion_fresh:
            return not parts.persona.stands_by_course
        return motion.speed > NEARLY_STANDS

    def look(self, *, was_mode: int, was_armed: bool, before: Before, now: float) -> None:
        """Detect what a heartbeat shows that is new; ``before`` is the state before it."""
        parts = self._parts
        armed, mode = parts.monitor.armed, parts.monitor.custom_mode
        if armed or mode != was_mode or now - self._undecided_at > UNDECIDED:
            self._joint.decide(now=now)
        if mode != was_mode:
            self._mode_changed(was_mode, mode, now=now)
        if was_armed and not armed:
            self._disarmed(before, now=now)
        parts.armings.shows(armed=armed, now=now)
        if armed and parts.armings.are_older(ours=parts.control.arming_asked_at, now=now):
            words = (
                "was armed by a delayed command: disarmed again."
                " Wait 5 s, then arm it if you mean it"
            )
            self._joint.on(Event.LATE_ARMING, Word(text=words), now=now)
        self.look_at_motion(now=now)
        by_hand = not parts.persona.manual_modes.isdisjoint((was_mode, mode))
        by_client = parts.armings.are_by_client(now=now)
        if armed and by_hand and not by_client and parts.control.is_asking_mode:
            self._taken(Event.TAKEN, "armed in a manual mode", now=now)
        self._shows_restart = False
        self._note_rest(now=now)
        self._note_others(now=now)

    def look_at_motion(self, *, now: float) -> None:
        """Detect that it drives to a place that it was sent to before a halt."""
        if now - self._parts.tasks.halts.at <= SHOWN_LATE and self._moves_late(now=now):
            words = "moves in HOLD because of a delayed command: HOLD sent again"
            self._joint.on(Event.LATE_MODE, Word(text=words), now=now)

    def rebooted(self, *, booted_at: float, now: float) -> None:
        """Handle a restart: its frame may have changed, and our requests are no longer in force.

        A restart disarms, so no person caused a disarming that was seen since ``booted_at``.
        """
        parts = self._parts
        if self._undecided_at < booted_at:
            self._joint.decide(now=now)
        parts.undecided.clear()  # it was the restart
        self._shows_restart = True
        parts.forget_answers()
        before, parts.authority.before = parts.authority.before, None
        if before is not None and before.at < booted_at:
            before = None
        could_arm = (before or parts.authority).may_arm
        was_paused = (before or parts.tasks).paused
        # heartbeats that show the disarming may be lost or under way
        was_armed = before or parts.monitor.armed or parts.control.is_engaged

        def restart() -> None:
            needs_person = parts.tasks.restarted(was_paused=was_paused, now=now)
            if needs_person and was_armed:
                parts.authority.restarted(was_allowed=could_arm)
            held, words = parts.tasks.held, "restarted"
            if held is not None:
                words += f": task {held.id} is held. Press {BUTTONS}, then Continue"
            parts.note(words, now=now)

        self._joint.on(Event.REBOOTED, Word(R.FRAME_RESET, text="restarted", do=restart), now=now)
        parts.monitor.restarted()
        parts.control.restarted()

    def learn(self, news: News, *, now: float) -> None:
        """Report a crossing of its own fence; correct an assumed takeover that was a failsafe's."""
        parts = self._parts
        if news.is_outside:
            parts.note("is outside its own fence: tasks wait", now=now)
        elif news.is_outside is not None:
            parts.tell("is inside its own fence again", now=now)
        if news.cause and parts.tasks.paused is R.TAKEOVER:
            words = f"was taken over by its failsafe: {news.cause}"
            if parts.tasks.halts.by_somebody.reason is R.TAKEOVER:
                self._joint.on(Event.EXPLAINED, Word(R.FAILSAFE, parts.actor, words), now=now)
            else:  # a command to halt stands beside it
                parts.note(words, now=now)

    def _taken(
        self, event: Event, what: str, *, now: float, reason: TaskReason = R.TAKEOVER
    ) -> None:
        self._joint.on(event, Word(reason, self._parts.actor, what), now=now)

    def _mode_changed(self, was_mode: int, mode: int, *, now: float) -> None:
        parts = self._parts
        persona, control = parts.persona, parts.control
        by_us, is_late = control.may_have_set(mode, now=now), self._comes_late(mode, now=now)
        ours = parts.authority.mode_changed(mode, by_us=by_us, is_late=is_late, now=now)
        if parts.tasks.is_stopped:
            if mode != persona.hold_mode:
                self._taken(Event.MODE_IN_STOP, "", now=now)
        elif mode == persona.booting_mode:
            self.rebooted(booted_at=now, now=now)
        elif self._shows_restart:
            pass  # a restart, which its clock has shown before: nobody changed the mode
        elif is_late:
            words = f"shows {persona.mode_name(mode)} because of a delayed command: HOLD sent again"
            self._joint.on(Event.LATE_MODE, Word(text=words), now=now)
        elif ours or was_mode == persona.booting_mode:
            pass
        else:
            self._judge(partial(self._changed_by_person, mode), now=now)
            if parts.monitor.armed:
                self._look_for_parking(was_mode, mode, now=now)

    def _judge(self, by_person: Callable[[float], None], *, now: float) -> None:
        """Take a change for a person's, unless a restart may have caused it: then it waits.

        The first heartbeat may come before a message with its clock, which tells of the restart. A
        task that waits for positions goes on by them only, and they carry the clock.
        """
        parts, task = self._parts, self._parts.tasks.active
        is_driven = task is not None and task.reason not in (R.LINK_LOST, R.POSITION_LOST)
        if parts.monitor.armed or is_driven or parts.authority.has_any_grant:
            by_person(now)
        else:
            parts.undecided.append(by_person)
            self._undecided_at = now

    def _changed_by_person(self, mode: int, now: float) -> None:
        """Handle a mode that a person, another program or a failsafe has set."""
        parts, persona = self._parts, self._parts.persona
        what = f"mode is {persona.mode_name(mode)}"
        cause = parts.failsafes.mode_changed(now=now)
        lapses = parts.control.is_streaming and mode == persona.hold_mode
        event = Event.LAPSED if lapses else Event.MODE
        if cause and lapses and parts.lease.has_silenced(now=now):
            event = Event.LAPSED_WITH_LEASE
        if cause:
            what = f"{what}, set by its failsafe: {cause}"
            self._taken(event, what, reason=R.FAILSAFE, now=now)
        else:
            self._taken(event, what, now=now)

    def _comes_late(self, mode: int, *, now: float) -> bool:
        """Return whether a mode request was sent before a halt and arrived after it.

        A manual mode is left to the person at the vehicle.
        """
        persona, halts = self._parts.persona, self._parts.tasks.halts
        if mode == persona.hold_mode or mode in persona.manual_modes:
            return False
        authority, ours = self._parts.authority, self._parts.control.mode_asked_at
        if halts.is_undone:
            return False
        if now <= self._may_show_until and not authority.was_asked(mode, ours=ours):
            return True  # nor has this server asked for it
        is_halted = now - halts.at <= SHOWN_LATE and halts.is_by_word
        return is_halted and authority.was_asked_before(mode, ours=ours, halt=halts.at)

    def _moves_late(self, *, now: float) -> bool:
        """Return whether a command from before a recent halt moves the vehicle in HOLD."""
        parts, halts = self._parts, self._parts.tasks.halts
        is_held = parts.monitor.custom_mode == parts.persona.hold_mode
        return (
            parts.persona.drives_in_hold
            and parts.monitor.armed
            and is_held
            and halts.is_by_word
            and not halts.is_undone
            and parts.authority.was_asked_before(ANY_MODE, halt=halts.at)
            and not parts.where.is_still(now=now)
        )

    def _look_for_parking(self, was_mode: int, mode: int, *, now: float) -> None:
        """If somebody who was driving sets HOLD, no waiting task may drive the vehicle off."""
        parts = self._parts
        others_drove, self._others_drive = self._others_drive, False
        follows = (parts.persona.hold_mode, parts.persona.control_mode)
        if mode == parts.persona.hold_mode and (others_drove or was_mode not in follows):
            self._taken(Event.PARKED, "", now=now)

    def _disarmed(self, before: Before, *, now: float) -> None:
        parts = self._parts
        is_expected = parts.control.may_have_disarmed(now=now) or parts.armings.is_to_be_disarmed
        if not is_expected and not self._shows_restart:
            self._judge(partial(self._disarmed_by_person, before), now=now)

    def _disarmed_by_person(self, before: Before, now: float) -> None:
        self._taken(Event.DISARMED, "disarmed", now=now)
        self._parts.authority.before = before  # it may turn out that a restart did it

    def _note_rest(self, *, now: float) -> None:
        """Learn its noise at rest while nothing can be telling it to move."""
        parts = self._parts
        follows = (parts.persona.hold_mode, parts.persona.control_mode)
        is_driven = parts.is_driven_by_others(now=now)
        if parts.monitor.armed and (is_driven or parts.monitor.custom_mode not in follows):
            parts.where.may_move()
        else:
            parts.where.told_to_stand(now=now)

    def _note_others(self, *, now: float) -> None:
        """Note that it moves without us: a HOLD after that means that somebody parked it."""
        parts = self._parts
        is_held = parts.monitor.custom_mode == parts.persona.hold_mode
        if parts.monitor.armed and not is_held and not parts.control.is_engaged:
            self._others_drive |= not parts.where.is_still(now=now)
