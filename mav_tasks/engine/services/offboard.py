"""Driving a vehicle from outside: take control, stream velocity setpoints, hand back, stop.

MAVLink guide, "Offboard Control Interface". First it waits for the next heartbeat: if somebody has
taken the vehicle since the last one, that shows it, and they keep it. Steps for ArduPilot: its
GUIDED mode, one zero setpoint (it keeps a setpoint from before and would drive off when armed:
observed), arm, zeros until seen armed, and only then motion. For PX4: HOLD, asked for even where it
is shown (one that shows it because the setpoints were lost would drive again by itself when they
return), arm, a second of zeros, OFFBOARD, motion. A mode or arm request is believed when a
HEARTBEAT shows it, not when it is acknowledged. The caller calls one of ``take``, ``drive``,
``release`` or ``stop`` at each setpoint period; each does the next thing that is due.
"""

from enum import Enum, auto
from math import inf

from mav_tasks.config.settings import Watch
from mav_tasks.engine.services.commands import Answered, CommandSender
from mav_tasks.engine.services.news import AWAITED, News
from mav_tasks.engine.services.orders import (
    ENDED,
    STANDING,
    STREAMING,
    Orders,
    Phase,
    Posture,
    Speeds,
    to_stand,
)
from mav_tasks.engine.services.persona import Persona
from mav_tasks.engine.services.retry import Insistence
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavResult
from mav_tasks.mavlink.messages import (
    CommandInt,
    CommandLong,
    Message,
    SetPositionTargetLocalNed,
)

STOP_REPEAT = 0.5  # s, between the HOLD requests of a STOP that is not confirmed yet
RELEASE_REPEAT = 1.0  # s, the same of a hand-back
STAND_UNSEEN = 3.0  # s of zeros after which a vehicle that cannot show that it stands gets HOLD
#: s, the same for one that was met driving: its first positions are asked for only then
REGAINED_UNSEEN = 1.0
ROLLS_OUT = 5.0  # s more, while it gets slower: the longest stop by zeros took 3.7 s
RELEASE_LIMIT = 3.0  # s, after which a vehicle outside our mode need not show HOLD any more
#: times, that one is asked which shows the very mode still that it was to leave: nobody has acted
INSISTS = 30
ANSWERED_BY = 5.0  # s, after which an answer to what was asked for in taking counts no more
LEAD_GAP = 0.2  # s between zeros, after which the stream counts anew
LEAD_IN = 1.0  # s of zeros before a mode that is entered only while setpoints stream
UNSTOPPED = 1.0  # s after which a STOP may depend on HOLD no more, where HOLD is not to be trusted
#: results of an arm request by a vehicle that may arm later: ArduPilot's, PX4's of two versions
NOT_READY = frozenset({MavResult.FAILED, MavResult.TEMPORARILY_REJECTED, MavResult.DENIED})


#: what is asked for in each phase of being taken
ASKED_IN = {
    Phase.ASKING_HOLD: MavCmd.DO_SET_MODE,
    Phase.ASKING_MODE: MavCmd.DO_SET_MODE,
    Phase.ASKING_ARM: MavCmd.COMPONENT_ARM_DISARM,
}


class Refused(Enum):
    """What the vehicle would not do."""

    MODE = auto()
    ARM = auto()


class OffboardControl:
    """Our hold on one vehicle."""

    def __init__(
        self, target: Address, persona: Persona, sender: CommandSender, watch: Watch
    ) -> None:
        self._target = target
        self._persona = persona
        self._orders = Orders(target, persona)
        self._sender = sender
        self._watch = watch
        self._news = News(persona)
        self._looks_since = -inf  # s, since when a heartbeat is awaited that shows whose it is
        self.wants_heartbeat = False
        self._looks_back = False  # while LOOKING: it was being handed back, or stopped
        #: what decides which set-point asks it to stand
        self.posture = Posture()
        self._outgoing: list[Message] = []
        self._insistence = Insistence()  # while being taken
        self._hold_until = -inf  # while RELEASING: HOLD is asked for until then
        self._next_hold_at = 0.0
        self._asks_left = 0  # times
        self._left_mode = -1  # which it showed when HOLD was asked for
        self._release_until: float | None = None  # zeros only, until then at the longest
        self._lead_until = 0.0  # zeros only, before our mode is asked for
        self._led_at = 0.0  # the last of them
        self._is_braking = False  # while STOPPING: zeros alone, as long as they slow it down
        self._disarm_by = inf  # while STOPPING: not seen in HOLD by then, it is disarmed
        self.phase = Phase.IDLE
        self.refused: Refused | None = None
        self._arm_result: int | None = None  # of the last arm request; None: no answer
        self.we_armed = False

    def __repr__(self) -> str:
        return f"OffboardControl({self.phase.name}, {self._news!r})"

    @property
    def in_control(self) -> bool:
        """Whether a non-zero setpoint may be sent."""
        return self.phase is Phase.CONTROL and self._news.armed and self._news.in_our_mode

    @property
    def follows(self) -> bool:
        """Whether setpoints move the vehicle, or zeros alone are braking it."""
        return self.in_control or (self.phase is Phase.STOPPING and self._is_braking)

    @property
    def is_not_ready(self) -> bool:
        """Return whether arming was refused in words that do not say "never"."""
        return self.refused is Refused.ARM and self._arm_result in NOT_READY

    @property
    def is_untouched(self) -> bool:
        """Whether nothing has been asked of a vehicle that is being taken."""
        return self.phase is Phase.LOOKING and not self._looks_back

    @property
    def is_engaged(self) -> bool:
        """Whether we are doing anything to the vehicle."""
        return self.phase is not Phase.IDLE

    @property
    def awaits_mode(self) -> bool:
        """Whether a mode that we have asked for is not answered yet."""
        return self._sender.is_pending(self._target.component_id, MavCmd.DO_SET_MODE)

    @property
    def is_asking_mode(self) -> bool:
        """Whether a mode is asked for, or about to be, so as to get into control."""
        return self.phase in (Phase.LOOKING, Phase.ASKING_HOLD, Phase.ASKING_MODE)

    @property
    def is_streaming(self) -> bool:
        """Whether setpoints are being sent, of which the vehicle may keep the last."""
        return self.phase in STREAMING

    @property
    def _may_move(self) -> bool:
        return self._news.armed or self._news.in_our_mode

    @property
    def _is_armed_in_hold(self) -> bool:
        return self._news.in_hold and self._news.armed

    @property
    def mode_asked_at(self) -> float:
        """When our mode was last asked for, s."""
        return self._news.mode_asked_at

    @property
    def arming_asked_at(self) -> float:
        """When arming was last asked for, s."""
        return self._news.arming_asked_at

    def apply(self, watch: Watch) -> None:
        self._watch = watch

    def adopt(self, persona: Persona) -> None:
        """Speak otherwise from now on: other setpoints, to the same make of vehicle."""
        self._persona = persona
        self._orders = Orders(self._target, persona)
        self._news.adopt(persona)

    def may_have_set(self, mode: int, *, now: float) -> bool:
        """Whether a change to this mode can be our own doing."""
        self._note_requests(now)
        return self._news.may_be_our_mode(mode, now=now)

    def may_have_disarmed(self, *, now: float) -> bool:
        """Whether a disarming just seen can be our own doing."""
        self._note_requests(now)
        return self._news.may_be_our_disarming(is_stopping=self.phase is Phase.STOPPING, now=now)

    def take_messages(self) -> list[Message]:
        """Return the setpoints to send since the last call."""
        outgoing, self._outgoing = self._outgoing, []
        return outgoing

    def heard(self, *, armed: bool, mode: int, now: float) -> None:
        if self._news.armed and not armed:
            self.we_armed = False
        self._news.heard(armed=armed, mode=mode, now=now)

    def outdated(self, *, until: float) -> None:
        """What is read until then has lain unread, and shows who had the vehicle before."""
        self._news.outdated(until=until)

    def restarted(self) -> None:
        """The vehicle has restarted: what it showed before proves nothing any more."""
        self.we_armed = False
        self._news.restarted()

    def answered(self, answer: Answered, *, now: float) -> None:
        """Take in the vehicle's answer, or its silence, to a mode or arm request of ours."""
        if answer.ack is not None and answer.ack.result == MavResult.ACCEPTED:
            self._news.accepted(is_mode=answer.command == MavCmd.DO_SET_MODE, now=now)
            if ASKED_IN.get(self.phase) == answer.command:
                self._insistence.accepted()
        elif ASKED_IN.get(self.phase) == answer.command:
            if answer.ack is not None:
                self._insistence.refused(now=now)
            if self.phase is Phase.ASKING_ARM:
                self._arm_result = None if answer.ack is None else answer.ack.result
        elif self.phase is Phase.DISARMING and answer.command == MavCmd.COMPONENT_ARM_DISARM:
            self.phase = Phase.IDLE

    def lose(self) -> None:
        """Somebody else has the vehicle, or may have: send not one thing more."""
        self._withdraw_requests()
        self._outgoing.clear()
        self._news.awaits_answer = False
        self.phase = Phase.IDLE
        self.refused = None
        self.we_armed = False

    def ask_to_stay(self, *, now: float) -> None:
        """HOLD is shown and was not asked for: ask for it, whoever has the vehicle.

        It may be a failsafe's, which ends as soon as a setpoint that is under way comes.
        """
        self._news.hold_asked_at = now
        self._request(self._orders.hold(), now=now)

    def keep_armed(self) -> None:
        """A client arms the vehicle, too: handed back, it stays armed as that client asked."""
        self.we_armed = False
        if self.phase is Phase.DISARMING:
            self._withdraw(MavCmd.COMPONENT_ARM_DISARM)
            self.phase = Phase.IDLE

    def disarm_at_end(self) -> None:
        """Whoever armed the vehicle has done with it: it is disarmed when we hand it back."""
        self.we_armed = self._news.armed

    def regain(self, *, now: float) -> None:
        """Count a vehicle as in control that shows our mode, armed: an earlier run drives it."""
        self.phase = Phase.CONTROL
        self._release_until = now + REGAINED_UNSEEN

    def hand_over(self) -> None:
        """Somebody else goes on from the hand-back, and HOLD asked for again would undo it.

        What was sent already is heard first; it is not called back.
        """
        if self.phase is Phase.RELEASING:
            self.phase = Phase.IDLE
            self.we_armed = False

    def take(self, *, may_arm: bool, now: float) -> None:
        """Get into control, one step a call; never moves the vehicle.

        What was not refused for good is asked for again, as long as ``ask_vehicle`` allows; what
        was, is in ``refused``, and the next call starts afresh.
        """
        self._note_requests(now)
        self._release_until = None
        if self.refused is not None:
            self.phase = Phase.IDLE
        if self.phase in ENDED and not self._shows_whose_it_is(now):
            self._look(now=now)
        news, arms_in_hold = self._news, self._persona.arms_in_hold
        is_in_place = news.in_hold if arms_in_hold else news.in_our_mode
        match self.phase:
            case Phase.LOOKING if not self._shows_whose_it_is(now):
                if self._looks_back and self._news.mode == self._persona.control_mode:
                    self._send_setpoint(STANDING)
            case Phase.DISARMING:  # seen through first: it could come true while we arm
                self._end_disarming()
            case Phase.ASKING_HOLD if not self._news.in_hold:
                self._insist(Refused.MODE, now=now)
            case Phase.ASKING_MODE if not self._news.in_our_mode and self._persona.arms_in_hold:
                if now > self._led_at + LEAD_GAP:  # the stream has ended: what is asked for, too
                    self._lead_in(now=now)
                else:
                    self._led_at = now
                    self._send_setpoint(STANDING)
                    self._insist(Refused.MODE, now=now)
            case Phase.ASKING_MODE if not self._news.in_our_mode:
                self._insist(Refused.MODE, now=now)
            case Phase.ASKING_ARM if is_in_place and not news.armed:
                self._send_setpoint(STANDING)
                self._insist(Refused.ARM, now=now)
            case Phase.LEADING_IN if self._is_armed_in_hold and self._is_leading_in(now):
                self._send_setpoint(STANDING)
            case Phase.CONTROL if self.in_control:
                self._send_setpoint(STANDING)
            case _ if self._persona.arms_in_hold:
                self._next_by_way_of_hold(may_arm=may_arm, now=now)
            case Phase.ASKING_ARM if self._news.in_our_mode:
                self._be_in_control()
            case _ if self._news.in_our_mode:
                self._begin_arming(may_arm=may_arm, now=now)
            case _:
                self._begin_asking(Phase.ASKING_MODE, now=now)
                self._ask_mode(now=now)

    def _look(self, *, now: float) -> None:
        """Await a heartbeat: the last is up to a second old, and a person may have it since."""
        self._looks_back = self.phase is not Phase.IDLE
        self._begin_asking(Phase.LOOKING, now=now)
        self._ask_to_show(now=now)

    def _ask_to_show(self, *, now: float) -> None:
        self._looks_since, self.wants_heartbeat = now, True

    def _shows_whose_it_is(self, now: float) -> bool:
        return self._news.is_newer_than(self._looks_since if self.phase is Phase.LOOKING else now)

    def _next_by_way_of_hold(self, *, may_arm: bool, now: float) -> None:
        """The next step of HOLD, arm, zeros, our mode; zeros at each, which do no harm."""
        if self._news.armed and self._news.in_our_mode:
            self._be_in_control()
        elif self.phase is Phase.ASKING_HOLD and not self._news.armed:
            self._begin_arming(may_arm=may_arm, now=now)
        elif self.phase in (Phase.ASKING_HOLD, Phase.ASKING_ARM) and self._news.in_hold:
            self._lead_in(now=now)
        elif self.phase is Phase.LEADING_IN and self._is_armed_in_hold:
            self._withdraw(MavCmd.DO_REPOSITION)
            self._begin_asking(Phase.ASKING_MODE, now=now)
            self._send_setpoint(STANDING)
            self._ask_mode(now=now)
        else:
            self._begin_asking(Phase.ASKING_HOLD, now=now)
            self._ask_hold(now=now)

    def _be_in_control(self) -> None:
        """What was asked for is shown, answered or not: asked again, it would undo a person's."""
        self._withdraw_requests()
        self._send_setpoint(STANDING)
        self.phase = Phase.CONTROL

    def _lead_in(self, *, now: float) -> None:
        """Begin the zeros that our mode is entered from.

        A PX4 keeps the place that it holds while it is disarmed, and drives there once it is armed:
        by then its estimate may have wandered off by more than it puts up with.
        """
        if self._persona.drives_in_hold:
            staying = self._orders.staying(changes_mode=False)
            self._sender.request(staying, now=now, give_up_after=LEAD_IN)
        self._begin_asking(Phase.LEADING_IN, now=now)
        self._lead_until, self._led_at = now + LEAD_IN, now
        self._send_setpoint(STANDING)

    def _is_leading_in(self, now: float) -> bool:
        """Whether the stream has not lasted yet, or nothing was heard of the vehicle after it.

        Somebody may have taken it meanwhile, and a mode is not asked for on old news.
        """
        if now > self._led_at + LEAD_GAP:
            self._lead_until = now + LEAD_IN
        self._led_at = now
        if now < self._lead_until:
            return True
        if self._looks_since < self._lead_until:
            self._ask_to_show(now=now)
        return not self._news.is_newer_than(self._looks_since)

    def drive(self, wanted: Speeds) -> None:
        """Send a velocity setpoint; zeros unless ``in_control``."""
        if self.is_streaming:
            self._release_until = None
            self._send_setpoint(wanted if self.in_control and wanted.is_finite else STANDING)

    def release(
        self,
        *,
        still: bool,
        disarm: bool,
        now: float,
        is_slowing: bool = False,
        is_deaf: bool = False,
    ) -> None:
        """Zeros until the vehicle stands, then HOLD until seen, then nothing more.

        A vehicle that cannot be seen to stand gets HOLD after a while all the same, later while it
        ``is_slowing``. With ``disarm`` a vehicle that we armed is disarmed in the end. One that is
        armed and does not follow set-points yet may be driving to a place: it gets HOLD at once,
        unless we are ``is_deaf`` to who has taken it.
        """
        self._note_requests(now)
        self.refused = None
        match self.phase:
            case Phase.LOOKING if self.is_untouched and (is_deaf or not self._may_move):
                self.phase = Phase.IDLE
            case Phase.LOOKING | Phase.ASKING_HOLD | Phase.ASKING_MODE:
                self.begin_release(now=now)
            case Phase.ASKING_ARM | Phase.LEADING_IN if (
                self._persona.drives_in_hold and not is_deaf
            ):
                self.begin_release(now=now)
            case Phase.ASKING_ARM | Phase.LEADING_IN | Phase.CONTROL:
                self._send_setpoint(STANDING)
                self._withdraw(MavCmd.COMPONENT_ARM_DISARM)
                if self._release_until is None:
                    self._release_until = now + STAND_UNSEEN
                limit = self._release_until + (ROLLS_OUT if is_slowing else 0.0)
                if still or now >= limit:
                    self.begin_release(now=now)
            case Phase.STOPPING:  # continued before it was confirmed
                self.begin_release(now=now)
            case Phase.RELEASING if self._news.in_hold:
                self._withdraw(MavCmd.DO_SET_MODE)
                self._end_release(disarm=disarm, now=now)
            case Phase.RELEASING if self._gives_up_hold(now):
                self._withdraw(MavCmd.DO_SET_MODE)
                self.phase = Phase.IDLE
            case Phase.RELEASING if now >= self._hold_until and self._news.is_silent(now):
                self._hold_until, self._asks_left = now, INSISTS  # until it is heard again
            case Phase.RELEASING:
                self._send_setpoint(STANDING)
                if now >= self._next_hold_at:
                    self._asks_left -= 1
                    self._request_hold(now=now, again_after=RELEASE_REPEAT)
            case Phase.DISARMING:
                self._end_disarming()

    def _end_disarming(self) -> None:
        """Believe it when it is shown, by a heartbeat that is no older than the request.

        One that is shown armed although it has accepted that was armed by somebody since.
        """
        component, command = self._target.component_id, MavCmd.COMPONENT_ARM_DISARM
        is_answered = not self._sender.is_pending(component, command)
        if self._news.is_settled and (is_answered or not self._news.armed):
            self.phase = Phase.IDLE
            self.we_armed = False

    def begin_release(self, *, now: float) -> None:
        """Zero and HOLD at once, on a vehicle in whatever mode; ``release`` sees it through."""
        self._withdraw_requests()
        self.phase = Phase.RELEASING
        self.refused = None
        self._hold_until, self._left_mode = now + RELEASE_LIMIT, self._news.mode
        self._asks_left = INSISTS
        self._news.unsettle(now, awaits_hold=True)
        self._send_setpoint(STANDING)
        self._request_hold(now=now, again_after=RELEASE_REPEAT)

    def _gives_up_hold(self, now: float) -> bool:
        """Whether it is time to ask a vehicle that does not show HOLD no more."""
        if self._news.in_our_mode or self._news.is_silent(now):
            return False
        shows_still = self._news.mode == self._left_mode
        return now >= self._hold_until and not (shows_still and self._asks_left > 0)

    def begin_stop(self, *, now: float, brake_for: float = 0.0) -> None:
        """Zero and HOLD at once, ahead of whatever was asked for; ``stop`` repeats them.

        With ``brake_for`` zeros alone, for so many seconds at the most, or until ``hold_now`` is
        called: for one that HOLD lets roll, and that is in our mode.
        """
        brakes = brake_for > 0.0 and self.in_control
        for command in (MavCmd.DO_SET_MODE, MavCmd.COMPONENT_ARM_DISARM):
            self._sender.cancel(self._target.component_id, command, now=now)
        self.phase = Phase.STOPPING
        self.refused = None
        self._disarm_by = now + UNSTOPPED if self._persona.stop_disarms else inf
        self._is_braking = brakes
        if brakes:
            self._send_setpoint(STANDING)
            self._next_hold_at = now + brake_for
            return
        self._news.unsettle(now, awaits_hold=True)
        self._send_setpoint(STANDING)
        self._request_hold(now=now, again_after=STOP_REPEAT)

    def hold_now(self, *, now: float) -> None:
        """While STOPPING: ask for HOLD, braking has no effect or was enough."""
        if self.phase is Phase.STOPPING and self._is_braking:
            self._is_braking = False
            self._news.unsettle(now, awaits_hold=True)
            self._send_setpoint(STANDING)
            self._request_hold(now=now, again_after=STOP_REPEAT)

    def disarm_now(self, *, now: float) -> None:
        """It moves in spite of all: ask for disarming, whoever armed it, in whatever phase."""
        if self.phase is Phase.IDLE:
            self._news.unsettle(now)
        self._request_disarming(now=now)

    def stop(self, *, still: bool, heard: bool, now: float) -> None:
        """Repeat zero and HOLD until HOLD is seen and the vehicle measured to stand.

        To one that is silent zeros go only together with HOLD, so that HOLD is the first that it
        hears when it hears again.
        """
        self._note_requests(now)
        if self.phase is not Phase.STOPPING:
            return
        is_news = self._news.is_settled or self._news.awaits_answer
        is_disarmed = self._persona.stop_disarms and is_news and not self._news.armed
        if heard and still and (self._news.in_hold or is_disarmed):
            self._withdraw_requests()
            self.phase = Phase.IDLE
            return
        if self._is_braking and (still or not heard or now >= self._next_hold_at):
            self.hold_now(now=now)
            return
        if now >= self._next_hold_at:
            self._request_hold(now=now, again_after=STOP_REPEAT)
            if self._is_hold_in_vain(now):
                self._request_disarming(now=now)
        elif not heard:
            return
        self._send_setpoint(STANDING)

    def zero_setpoint(self, *, armed: bool = False) -> SetPositionTargetLocalNed:
        """Return the setpoint that asks the vehicle to stand; ``armed``: it may be so by then."""
        armed = armed or self._news.armed
        return self._orders.velocity(to_stand(self._persona, self.posture, armed=armed))

    @property
    def holds_first(self) -> bool:
        """Whether commands leave before setpoints.

        HOLD also stops a vehicle that ignores setpoints, and a zero before it would end the HOLD of
        a loss failsafe. Otherwise, in our mode, a zero must come before arming.
        """
        is_handed_back = self.phase is Phase.RELEASING and self._persona.has_loss_failsafe
        return is_handed_back or self.phase is Phase.STOPPING

    def zero_and_hold(self) -> tuple[Message, Message]:
        """Return both, to be sent once each; HOLD first if a zero would end a failsafe's HOLD."""
        zero, hold = self.zero_setpoint(), self._orders.hold()
        return (hold, zero) if self._persona.has_loss_failsafe else (zero, hold)

    def _note_requests(self, now: float) -> None:
        """Remember until when what we ask for was still being asked for."""
        match self.phase:
            case Phase.ASKING_MODE:
                self._news.mode_asked_at = now
            case Phase.STOPPING if self._is_braking:
                pass  # HOLD is not asked for yet: who shows it was switched by a person
            case Phase.ASKING_HOLD | Phase.RELEASING | Phase.STOPPING:
                self._news.hold_asked_at = now
            case Phase.DISARMING:
                self._news.disarming_asked_at = now
            case Phase.ASKING_ARM if self.we_armed:
                self._news.arming_asked_at = now

    def _begin_asking(self, phase: Phase, *, now: float) -> None:
        self._withdraw_requests()
        self.refused = None
        self.phase = phase
        self._insistence.begin(until=now + self._watch.ask_vehicle)

    def _begin_arming(self, *, may_arm: bool, now: float) -> None:
        """In the mode for it: clear what setpoint there was, then see to arming."""
        self._begin_asking(Phase.ASKING_ARM, now=now)
        self._send_setpoint(STANDING)
        if not self._news.armed and may_arm:
            self.we_armed = True
            self._ask_arming(now=now)

    def _insist(self, what: Refused, *, now: float) -> None:
        """Ask again for what was refused or not answered, or take it for an answer."""
        if self._insistence.is_refusal(now):
            self._give_up(what)
        elif self._insistence.is_due(now):
            if not self._insistence.has_looked:
                self._insistence.has_looked = True
                self._ask_to_show(now=now)
            if self._news.is_newer_than(self._looks_since):
                if self._insistence.is_in_vain(now):
                    self._give_up(what)
                else:
                    self._ask_again(what, now=now)

    def _give_up(self, what: Refused) -> None:
        self.refused = what
        self.we_armed = False
        self._news.awaits_answer = False

    def _ask_again(self, what: Refused, *, now: float) -> None:
        if what is Refused.ARM:
            self._ask_arming(now=now)
        elif self.phase is Phase.ASKING_HOLD:
            self._ask_hold(now=now)
        else:
            self._ask_mode(now=now)

    def _ask_mode(self, *, now: float) -> None:
        self._news.mode_asked_at = now
        self._news.unsettle(now, mode=self._persona.control_mode)
        self._ask(self._orders.mode(self._persona.control_mode), now=now)

    def _ask_hold(self, *, now: float) -> None:
        self._news.hold_asked_at = now
        self._news.unsettle(now, awaits_hold=True)
        self._ask(self._orders.hold(), now=now)

    def _ask_arming(self, *, now: float) -> None:
        self._news.arming_asked_at = now
        self._ask(self._orders.arming(arm=True), now=now)

    def _ask(self, command: CommandLong, *, now: float) -> None:
        """Ask once, of which a copy goes only when it is seen that nobody has acted since."""
        self._insistence.asked(now=now)
        if not self._sender.repeat(command, now=now):
            self._sender.request(command, now=now, give_up_after=ANSWERED_BY, repeats=False)

    def _end_release(self, *, disarm: bool, now: float) -> None:
        if disarm and self.we_armed:  # also where that was asked for and is not seen yet
            self.phase = Phase.DISARMING
            self._news.unsettle(now)
            self._request_disarming(now=now)
        else:
            self.phase = Phase.IDLE

    def _request_hold(self, *, now: float, again_after: float) -> None:
        self._news.hold_asked_at = now
        self._next_hold_at = now + again_after
        self._request(self._orders.hold(), now=now)
        if self._persona.drives_in_hold and self._news.mode == self._persona.hold_mode:
            self._request(self._orders.staying(changes_mode=True), now=now)

    def _request_disarming(self, *, now: float) -> None:
        self._news.disarming_asked_at = now
        self._request(self._orders.arming(arm=False), now=now)

    def _is_hold_in_vain(self, now: float) -> bool:
        """Whether a vehicle whose HOLD is not to be trusted has not shown it in time."""
        if now < self._disarm_by or not self._news.armed or self._news.in_hold:
            return False
        # a heartbeat each second may be a little late, and show that all is well
        return self._news.is_settled or now >= self._disarm_by + AWAITED - UNSTOPPED

    def _request(self, command: CommandLong | CommandInt, *, now: float) -> None:
        """Send what makes it stand or disarms it, ahead of what waits."""
        limit = self._watch.ask_vehicle
        self._sender.request(command, now=now, give_up_after=limit, immediate=True)

    def _withdraw_requests(self) -> None:
        self._withdraw(MavCmd.DO_SET_MODE)
        self._withdraw(MavCmd.COMPONENT_ARM_DISARM)

    def _withdraw(self, command: MavCmd) -> None:
        self._sender.withdraw(self._target.component_id, command)

    def _send_setpoint(self, wanted: Speeds) -> None:
        if wanted == STANDING:
            wanted = to_stand(self._persona, self.posture, armed=self._news.armed)
        self._outgoing.append(self._orders.velocity(wanted))


def is_request_of(answer: Answered) -> bool:
    """Whether an answer belongs to a mode or arm request of ours."""
    return answer.origin is None and answer.command in (
        MavCmd.DO_SET_MODE,
        MavCmd.COMPONENT_ARM_DISARM,
    )
