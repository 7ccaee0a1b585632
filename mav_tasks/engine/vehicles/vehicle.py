"""One vehicle: what it says, what its tasks demand, and how the demand is carried out.

Its rule of order: STOP before everything; what somebody else did to the vehicle before what we
want; and no setpoint at all to a vehicle that is not ours.
"""

from collections.abc import Hashable
from collections.abc import Set as AbstractSet
from dataclasses import replace
from math import inf

from mav_tasks.engine.outlet import Outlet
from mav_tasks.engine.vehicles.authority import Authority, Before
from mav_tasks.engine.vehicles.components import Components
from mav_tasks.engine.vehicles.hold_before import HoldBefore
from mav_tasks.engine.vehicles.home_command import home_meant
from mav_tasks.engine.vehicles.known_profile import KnownProfile
from mav_tasks.engine.vehicles.motion_guard import Found, Measure, MotionGuard, Told
from mav_tasks.engine.vehicles.own_failsafes import News, OwnFailsafes
from mav_tasks.engine.vehicles.sender_clock import Heard, Stamped
from mav_tasks.engine.vehicles.setpoint_clock import SetpointClock
from mav_tasks.engine.vehicles.shown_heartbeat import ShownHeartbeat
from mav_tasks.engine.vehicles.start_mark import StartMark
from mav_tasks.engine.vehicles.stick_watch import StickWatch
from mav_tasks.engine.vehicles.vehicle_requests import VehicleRequests
from mav_tasks.engine.vehicles.whereabouts import Whereabouts
from mav_tasks.errors import Rejection
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services.command_sender import Standing
from mav_tasks.services.heartbeat import HeartbeatMonitor
from mav_tasks.services.identity import identity_of
from mav_tasks.services.offboard import Phase, Refused
from mav_tasks.services.orders import Posture, Speeds
from mav_tasks.services.persona import Persona
from mav_tasks.settings import SET_FAILSAFE, Settings, Turning
from mav_tasks.tasks.book import TaskBook
from mav_tasks.tasks.driving.guidance import ZERO
from mav_tasks.tasks.events import SERVER, VehicleNoted, VehicleSeen
from mav_tasks.tasks.goal import GlobalPlace, ends_at_home
from mav_tasks.tasks.lifecycle import LOSSES, TAKEN, TaskReason, TaskState
from mav_tasks.tasks.task import Draft, Task, TaskId, Terms
from mav_tasks.tasks.vehicle_tasks import VehicleTasks
from mav_tasks.tasks.view import STOP, Demand, DemandKind, VehicleView

NO_MISSION = (0, 0xFFFF)  # MISSION_CURRENT.total: it does not say; there is none
RUNNING = frozenset({TaskState.STARTING, TaskState.EXECUTING, TaskState.CANCELLING})
LATE_REQUESTS = 3.5  # s after a STOP, in which requests that left before it may still arrive
REORDERED = 64  # packets that a net can put one behind others
REORDERED_WITHIN = 0.5  # s; after a longer silence a smaller number is a restart
#: s in which a vehicle that was told to move and says that it stands may be stopping all the same
UNSEEN_STOP = 3.0
#: a station's buttons for a held task
BUTTONS = '"Held: rest", "Held: again" or "Held: skip"'
BRAKES_FOR = 8.0  # s of set-points before a STOP's HOLD at the most; the longest stop took 4
REFUSALS = {
    None: TaskReason.NONE,
    Refused.MODE: TaskReason.MODE_REFUSED,
    Refused.ARM: TaskReason.ARM_REFUSED,
}


class Vehicle:
    """The vehicle with one system id, on one place of a vehicle link."""

    def __init__(
        self,
        system_id: int,
        *,
        heartbeat: m.Heartbeat,
        persona: Persona,
        outlet: Outlet,
        book: TaskBook,
        tasks: VehicleTasks,
        settings: Settings,
        may_arm: bool,
        now: float,
    ) -> None:
        self.system_id = system_id
        self.persona = persona
        self.tasks = tasks
        self.requests = VehicleRequests(
            Address(system_id, AUTOPILOT),
            persona,
            outlet,
            source=Address(settings.identity.system_id, settings.identity.component_id),
            watch=settings.watch,
            now=now,
        )
        self.control = self.requests.control
        self.last_heartbeat: Packet | None = None
        self.last_seq = 0  # of the autopilot's packets
        self._number = 0  # the same, counted on beyond 255
        self._last_beat = (0, -inf)  # number of the last heartbeat, and when it came
        self._book = book
        self._settings = settings
        self.where = Whereabouts(settings.watch, tasks.bounds)
        self._monitor = HeartbeatMonitor(
            heartbeat, lost_after=settings.watch.heartbeat_lost, now=now
        )
        self.control.heard(armed=self._monitor.armed, mode=self._monitor.custom_mode, now=now)
        self._authority = Authority(persona, may_arm=may_arm)
        self._clock = SetpointClock(system_id, period=settings.watch.setpoint_period)
        self._was_heard = True
        self._shows_restart = False  # until the heartbeat comes that does, too
        self._failsafes = OwnFailsafes()
        self._others_drive = False  # it moved in a mode in which nothing of ours drove it
        self._is_closing = False
        self._is_back_home = False  # by its last task; it is disarmed also where others wait
        self._stops_task = False  # which the end of the server has interrupted
        self.stopped_at = -inf  # the last STOP
        #: a HOLD that a "go to" may undo
        self.hold_before = HoldBefore()
        #: whether its mission begins when it is armed
        self.start_mark = StartMark()
        self._own_items = 0  # of a mission on board
        self._guard = MotionGuard(self.where.motion, settings.watch)
        self._sticks = StickWatch()
        #: what was measured of it beforehand
        self.known = KnownProfile(persona)
        self.known.apply(settings.profiles, system_id)
        #: what its heartbeats say towards clients
        self.shown = ShownHeartbeat()
        self.components = Components(system_id, first=settings.identity.component_id)

    def __repr__(self) -> str:
        return f"Vehicle({self.system_id}, {self.control!r}, {self.tasks!r})"

    @property
    def setpoint_period(self) -> float:
        """Seconds from one setpoint to the next, as they should be."""
        return self._settings.watch.setpoint_period

    @property
    def server_component(self) -> int:
        """The component id under which the task server appears inside this vehicle's system."""
        return self.components.server.component_id

    @property
    def server_address(self) -> Address:
        """The task server's address inside this vehicle's system."""
        return self.components.server

    @property
    def armed(self) -> bool:
        """Whether the vehicle was last seen armed."""
        return self._monitor.armed

    @property
    def heartbeat(self) -> m.Heartbeat:
        """What it said last."""
        return self._monitor.latest

    @property
    def is_by_hand(self) -> bool:
        """Whether it is in a mode in which a person drives."""
        return self._monitor.custom_mode in self.persona.manual_modes

    @property
    def may_drive_on(self) -> bool:
        """Whether it might not stand without setpoints, though it must; unsaid, it is believed."""
        if self._settings.loss_failsafe != "must_stand":
            return False
        failsafe = self.requests.loss_failsafe
        return bool(failsafe.awaits_answer or failsafe.why_off or self.known.why_drives_on)

    @property
    def heard_at(self) -> float:
        """When its last heartbeat came."""
        return self._monitor.heard_at

    def is_heard(self, *, now: float) -> bool:
        """Whether its heartbeats are coming."""
        return self._monitor.is_heard(now=now)

    # what comes in

    def count(self, seq: int) -> None:
        """Take note of the number of a packet of its autopilot."""
        self._number += (seq - self.last_seq + 0x80 & 0xFF) - 0x80
        self.last_seq = seq

    def is_overtaken(self, *, now: float) -> bool:
        """Whether a newer heartbeat came just before the one just counted."""
        number, at = self._last_beat
        if 0 < number - self._number <= REORDERED and now - at <= REORDERED_WITHIN:
            return True
        self._last_beat = self._number, now
        return False

    def comes_anew(self) -> None:
        """It is on another connection: its numbers may begin anew, and it may be another one."""
        self._last_beat = (0, -inf)
        self.requests.ask_which_again()

    def move_to(self, outlet: Outlet, *, may_arm: bool) -> None:
        """It is heard at another endpoint now; ``may_arm``: whether we may arm what is there."""
        self.comes_anew()
        self.requests.move_to(outlet)
        self._authority.moved(may_arm=may_arm)

    def come_back(self, *, was_driven: bool, now: float) -> None:
        """A vehicle of an earlier run is heard: first of all it stands, if we left it driving.

        If somebody else had taken it over or disarmed it, we do not arm it before a person lets us
        go on.
        """
        if self.tasks.paused in TAKEN or not self.tasks.may_be_armed:
            self._withdraw_arming(now=now)
        if self.tasks.is_stopped:
            self._begin_stop(now=now)
        elif was_driven and self._may_still_be_driven:
            self.control.begin_release(now=now)
            self.requests.flush(now=now)
            self._plan_tick(now=now)
        elif was_driven and self.persona.has_loss_failsafe:
            # a setpoint would have it enter our mode and lose the next ones again
            mode = self.persona.mode_name(self._monitor.custom_mode)
            words = f"is in {mode}, by its failsafe or by somebody, and is left to it"
            self._note(f"{words}: HOLD stops it, then release its task", now=now)
        elif was_driven:
            self.requests.send_zero()

    @property
    def _may_still_be_driven(self) -> bool:
        """Whether it follows setpoints, or would if one came: it holds because they were lost."""
        mode, persona = self._monitor.custom_mode, self.persona
        is_lost = persona.has_loss_failsafe and mode == persona.hold_mode
        return is_lost or mode == persona.control_mode

    def receive(self, message: m.Message, component_id: int, *, now: float) -> None:
        """Take in a message that the server itself makes use of."""
        if isinstance(message, m.CommandAck):
            self.requests.receive(message, component=component_id, now=now)
            self._ask_for_rates(now=now)
        elif component_id != AUTOPILOT:
            if isinstance(message, m.Heartbeat):
                self._note_component(component_id, now=now)
        elif isinstance(message, m.Heartbeat):
            self._receive_heartbeat(message, now=now)
        elif isinstance(message, Stamped):
            due = self._clock.next_at  # a setpoint that is late is followed by a zero
            if self.where.receive(message, now=now, not_after=due) is Heard.RESTART:
                self._rebooted(booted_at=now - message.time_boot_ms / 1000, now=now)
                self.where.receive(message, now=now, not_after=due)
            self._look_at_frame(now=now)
            if not self._clock.is_running and not self.tasks.is_idle:
                self.step(now=now)
        elif isinstance(message, m.GpsGlobalOrigin | m.HomePosition):
            self.where.frame.receive(message)
            self._look_at_frame(now=now)
        elif isinstance(message, m.MissionRequest | m.MissionRequestInt | m.MissionAck):
            self.requests.receive_of_plan(message, now=now)
        elif isinstance(message, m.MissionCurrent):
            self._receive_own_mission(message.total, now=now)
        elif isinstance(message, m.Statustext):
            sender = Address(self.system_id, component_id)
            news = self._failsafes.receive_text(sender, message, now=now)
            self._learn_of_failsafe(news, now=now)
        elif isinstance(message, m.SysStatus):
            self._learn_of_failsafe(self._failsafes.receive_status(message, now=now), now=now)
        elif isinstance(message, m.ParamValue):
            self._receive_parameter(message, now=now)
        elif isinstance(message, m.RcChannels):
            sent_at = self.where.clock.sent_at(message.time_boot_ms, now=now)
            moved = self._sticks.look(message, armed=self.armed, sent_at=sent_at)
            if moved and self.control.is_engaged:
                self._stick_moved(now=now)
        elif isinstance(message, m.AutopilotVersion):
            identity = identity_of(message)
            self.tasks.identified(identity.uid, now=now)
            self.requests.is_identified = True
            self.known.identify(identity)
            self._use_profile(now=now)

    def _receive_own_mission(self, total: int, *, now: float) -> None:
        """What is on board is none of ours: its mission mode would drive it, and nobody sees it."""
        items = total if total not in NO_MISSION else 0
        if items and items != self._own_items and self._settings.claim:
            self._note(f"carries {items} mission items of its own: see its mission mode", now=now)
        self._own_items = items

    def _receive_parameter(self, message: m.ParamValue, *, now: float) -> None:
        self.requests.loss_failsafe.receive(message)
        self.requests.cruise.receive(message)
        self.tasks.cruises(self.requests.cruise.speed)
        self._note_failsafe(now=now)
        turning = self.requests.turning
        before = turning.turning
        turning.receive(message)
        self.known.turns(turning.turning, turning.radius)
        if turning.turning is not before:
            self._use_profile(now=now)
        if turning.turning is Turning.STEERED is not before:
            self._book.record(VehicleSeen(self.system_id, "steers as a car", now))
        self.wake(now=now)

    def _note_failsafe(self, *, now: float) -> None:
        failsafe = self.requests.loss_failsafe
        news = failsafe.take_news()
        if news and failsafe.why_off:
            news = f"{news}. To make it stand: {SET_FAILSAFE}"
        if news and (failsafe.is_unknown or failsafe.why_off):
            self._note(news, now=now)
        elif news:
            self._book.record(VehicleSeen(self.system_id, news, now))

    def _look_at_frame(self, *, now: float) -> None:
        if self.where.frame.changed:
            self.where.frame.changed = False
            self._note("has another origin", now=now)
            self.tasks.hold(TaskReason.FRAME_RESET, now=now)

    def _receive_heartbeat(self, heartbeat: m.Heartbeat, *, now: float) -> None:
        was_armed, was_mode = self._monitor.armed, self._monitor.custom_mode
        before = Before(now, self._authority.may_arm, self.tasks.paused)
        self._monitor.receive(heartbeat, now=now)
        armed, mode = self._monitor.armed, self._monitor.custom_mode
        self.control.heard(armed=armed, mode=mode, now=now)
        if armed:
            self._keep_home(self.where.frame.home if was_armed else self.where.here, now=now)
        if not self._was_heard:
            self._heard_again(now=now)
        if mode != was_mode:
            self._mode_changed(was_mode, mode, now=now)
        if was_armed and not armed:
            self._disarmed(before, now=now)
        by_hand = not self.persona.manual_modes.isdisjoint((was_mode, mode))
        by_client = self._authority.armed_by_client(now=now)
        if armed and by_hand and not by_client and self.control.is_asking_mode:
            self._take_over("armed to be driven by hand", now=now)
        self._shows_restart = False
        self._note_rest(now=now)
        self._note_others(now=now)
        if not self._clock.is_running:
            self.step(now=now)
        self._ask_for_rates(now=now)
        self.requests.ask_for_parameters()
        self._note_failsafe(now=now)
        self._use_profile(now=now)

    def _note_rest(self, *, now: float) -> None:
        """What it measures at rest is learnt while nothing can be telling it to move."""
        driven = self._authority.since_other(now=now) < self._settings.watch.other_controller
        follows = (self.persona.hold_mode, self.persona.control_mode)
        if self.armed and (driven or self._monitor.custom_mode not in follows):
            self.where.motion.standstill.may_move()
        else:
            self.where.motion.standstill.told_to_stand(now=now)

    def _note_others(self, *, now: float) -> None:
        """Note that it moves, and that we do not move it: who then sets HOLD has parked it."""
        is_held = self._monitor.custom_mode == self.persona.hold_mode
        if self.armed and not is_held and not self.control.is_engaged:
            self._others_drive |= not self.where.motion.is_still(now=now)

    def _keep_home(self, place: GlobalPlace | None, *, now: float) -> None:
        """Where it is first armed is its home; one met armed has said where that was."""
        frame = self.where.frame.frame()
        if place and frame and self.tasks.bounds.home_in(frame) is None:
            self.tasks.set_home(place, frame, actor=SERVER, now=now)

    def home_was_set(self, command: m.Message, *, actor: str, now: float) -> None:
        """A client's DO_SET_HOME was accepted: its tasks return there, too."""
        place, frame = home_meant(command) or self.where.here, self.where.frame.frame()
        if place and frame:
            self.tasks.set_home(place, frame, actor=actor, now=now)

    def _use_profile(self, *, now: float) -> None:
        """Go by what was measured of it; setpoints do not change their kind while it is driven."""
        news = self.known.take_news()
        if news and self.known.chosen is None:
            self._note(news, now=now)
        elif news:
            self._book.record(VehicleSeen(self.system_id, news, now))
        self.tasks.brakes(self.known.stop)
        persona = self.known.persona
        speaks_alike = (persona.setpoint_mask, persona.setpoint_frame) == (
            self.persona.setpoint_mask,
            self.persona.setpoint_frame,
        )
        if persona != self.persona and (speaks_alike or not self.control.is_engaged):
            self.persona = persona
            self.requests.adopt(persona)

    def _heard_again(self, *, now: float) -> None:
        self._was_heard = True
        self.requests.ask_which_again()
        self._book.record(VehicleSeen(self.system_id, "heard again", now))
        if self.control.phase is Phase.STOPPING:
            self._begin_stop(now=now)

    def _mode_changed(self, was_mode: int, mode: int, *, now: float) -> None:
        booting = self.persona.booting_mode
        by_us = self.control.may_have_set(mode, now=now)
        ours = self._authority.mode_changed(mode, by_us=by_us, now=now)
        if self.tasks.is_stopped:
            self._mode_changed_in_spite_of_stop(mode, now=now)
        elif mode == booting:
            self._rebooted(booted_at=now, now=now)
        elif self._shows_restart:
            pass  # a restart, which its clock has told of before, and nobody's doing
        elif not ours and was_mode != booting:
            self._withdraw_arming(now=now)
            may_be_lost = self.control.is_streaming and mode == self.persona.hold_mode
            self._take_over_by_mode(mode, now=now)
            self._note_parking(was_mode, mode, now=now)
            if may_be_lost and self.persona.has_loss_failsafe:
                self.control.ask_to_stay(now=now)
                self.requests.flush(now=now)

    def _note_parking(self, was_mode: int, mode: int, *, now: float) -> None:
        """Somebody who was driving sets HOLD: what waits does not drive it off from there."""
        others_drove, self._others_drive = self._others_drive, False
        if mode != self.persona.hold_mode or not self.armed or self.tasks.is_empty:
            return
        was_of_others = was_mode not in (self.persona.hold_mode, self.persona.control_mode)
        if (was_of_others or others_drove) and self.tasks.paused not in TAKEN:
            actor = f"vehicle {self.system_id}"
            self.tasks.pause(TaskReason.TAKEOVER, actor=actor, now=now)

    def _mode_changed_in_spite_of_stop(self, mode: int, *, now: float) -> None:
        """A request from before the STOP was late. Later, it is a person at the vehicle."""
        if mode == self.persona.hold_mode:
            return
        self._withdraw_arming(now=now)
        if now - self.stopped_at <= LATE_REQUESTS and not self.control.is_engaged:
            self._begin_stop(now=now)

    def _disarmed(self, before: Before, *, now: float) -> None:
        if self.control.phase is Phase.STOPPING or self.control.may_have_disarmed(now=now):
            return
        if self._shows_restart:  # this heartbeat, or the clock before it, has told of that as well
            was_allowed = before.may_arm or self._authority.is_withdrawn_by_restart
            self._authority.restarted(was_allowed=was_allowed)
            return
        self._withdraw_arming(now=now)
        self._zero_what_is_kept()
        self._take_over("disarmed", now=now)
        self._authority.note_disarmed(before)  # a restart may turn out to have done it

    def _rebooted(self, *, booted_at: float, now: float) -> None:
        """Its frame may be another one now, and nothing of ours is in force there.

        A restart disarms: what was seen since ``booted_at`` was no person's doing.
        """
        self._shows_restart = True
        self._failsafes = OwnFailsafes()
        self.where.forget()
        self.requests.ask_which_again()
        self.requests.intervals.ask_all_again()
        self.requests.loss_failsafe.forget()
        self.requests.turning.forget()
        self.requests.cruise.forget()
        self._sticks.forget()
        self.forget_start()
        before = self._authority.take_disarmed(since=booted_at)
        if self.tasks.is_stopped:
            self._note("restarted", now=now)
            return
        was_engaged = self.control.is_engaged
        self.control.lose()
        self.hold_before.forget()
        self.requests.end_performing()
        was_paused = self.tasks.paused if before is None else before.paused
        begins_again = self.tasks.restarted(was_paused=was_paused, now=now)
        if before is not None:
            self._authority.restarted(was_allowed=before.may_arm)
        elif was_engaged and not begins_again:
            self._authority.restarted(was_allowed=self._authority.may_arm)
        held = self.tasks.held
        words = "restarted"
        if held is not None:
            words += f": task {held.id} is on hold. Release it ({BUTTONS}), then continue"
        self._note(words, now=now)

    def _take_over_by_mode(self, mode: int, *, now: float) -> None:
        """A mode that we did not ask for: a person's, or that of a failsafe that it tells of."""
        what = f"mode is {self.persona.mode_name(mode)}"
        cause = self._failsafes.mode_changed(now=now)
        if cause:
            self._take_over(f"{what}, by its failsafe: {cause}", TaskReason.FAILSAFE, now=now)
        else:
            self._take_over(what, now=now)

    def _learn_of_failsafe(self, news: News, *, now: float) -> None:
        """Tell where it is, and, if that was a takeover so far, what has taken it."""
        if news.is_outside:
            self._note("is outside its own fence: tasks wait", now=now)
        elif news.is_outside is not None:
            words = "is inside its own fence again"
            self._book.record(VehicleSeen(self.system_id, words, now))
        if news.cause and self.tasks.paused is TaskReason.TAKEOVER:
            self._note(f"was taken by its failsafe: {news.cause}", now=now)
            actor = f"vehicle {self.system_id}"
            self.tasks.pause(TaskReason.FAILSAFE, actor=actor, now=now)

    def _take_over(
        self, what: str, reason: TaskReason = TaskReason.TAKEOVER, *, now: float
    ) -> None:
        """Somebody else has the vehicle: let go, and let the queue stand if a task has begun."""
        actor = f"vehicle {self.system_id}"
        self.tasks.halt(reason, actor=actor, now=now)
        if self.tasks.is_stopped:
            return
        self._take_back()
        self.control.lose()
        self.requests.end_performing()
        begun = self.tasks.begun
        if begun is None:
            return
        if begun.state in RUNNING or self.tasks.paused not in TAKEN:
            self._note(f"taken over: {what}", now=now)
            self.tasks.pause(reason, actor=actor, now=now)

    @property
    def _goes_on_by_itself(self) -> bool:
        """Whether a task stands only as long as the vehicle, or its position, is not heard of."""
        begun = self.tasks.begun
        return begun is not None and begun.state is TaskState.PAUSED and begun.reason in LOSSES

    def _withdraw_arming(self, *, now: float) -> None:
        """Somebody else has a hand on it: it is armed no more, also after a restart of ours."""
        self._authority.withdraw_arming()
        self.tasks.let_arm(may_be_armed=False, now=now)

    def _restore_arming(self, *, now: float) -> None:
        """A person said that all is well."""
        self._authority.restore_arming()
        self.tasks.let_arm(may_be_armed=True, now=now)

    def _take_back(self, *, is_hold: bool = False) -> None:
        """A halt: nothing that was asked for before it moves the vehicle later."""
        if not is_hold:
            self.hold_before.forget()
        self.forget_start()
        self.tasks.forget_release()
        self._authority.revoke()  # a stream that goes on must not drive when the mode comes back
        self.requests.drop_what_waits()

    def _zero_what_is_kept(self) -> None:
        """Leave no velocity behind: the vehicle keeps the last one and drives off when armed."""
        if self.control.is_streaming:
            self.requests.send_zero()

    def _note_component(self, component_id: int, *, now: float) -> None:
        before = self.server_component
        if component_id not in self.components and self.components.note(component_id):
            words = f"component {before} is its own; tasks are at {self.server_component}"
            self._note(words, now=now)

    # what clients ask for, beyond tasks

    def relay(
        self,
        packet: Packet,
        message: m.Message,
        origin: Hashable,
        *,
        command: int,
        actor: str,
        standing: Standing,
        now: float,
    ) -> None:
        """Forward a client's command; its answer comes from ``requests``."""
        asked = getattr(message, "target_component", 0)
        # an autopilot answers for every component that is not there, and does as it was told
        target = asked if asked in self.components else AUTOPILOT
        disarms = command == MavCmd.COMPONENT_ARM_DISARM and getattr(message, "param1", 1.0) == 0.0
        if command == MavCmd.COMPONENT_ARM_DISARM and not disarms:
            self._authority.client_arms(now=now)
            self.control.keep_armed()
        if disarms:
            self.tasks.halt(TaskReason.DISARMED, actor=actor, now=now)
            self._withdraw_arming(now=now)  # also where it is disarmed already
        if disarms and self.control.is_engaged and self.control.phase is not Phase.STOPPING:
            self._zero_what_is_kept()
            self._take_over("disarmed by a client", now=now)
        elif disarms:
            is_driven = self._authority.since_other(now=now) < self._settings.watch.other_controller
            self._take_back()  # a client's stream would leave a velocity behind
            if is_driven and not self.persona.has_loss_failsafe:
                self.requests.send_zero()
        self.requests.relay(
            packet,
            message,
            origin,
            component=target,
            command=command,
            standing=standing,
            urgent=disarms,
            now=now,
        )

    def perform(self, command: m.CommandLong | m.CommandInt, *, now: float) -> None:
        """Have the vehicle carry out what an item of a plan orders."""
        begun = self.tasks.begun
        if self.tasks.is_stopped or (begun is not None and begun.state not in RUNNING):
            return  # called off in the very step in which it was ordered
        self.requests.perform(command, now=now)

    def client_asks_mode(self, mode: int, client: Hashable, *, now: float) -> None:
        """Note that a client's mode request goes to the vehicle through us.

        Our own mode then counts as set by us. Any other one is a takeover, believed when a
        heartbeat shows it; but nothing that we still ask for may work against it.
        """
        self.forget_start()
        present_mode = self._monitor.custom_mode
        self._authority.client_asks(mode, client, present_mode=present_mode, now=now)
        self.control.hand_over()
        if mode == self.persona.control_mode:
            streams = self._authority.streams(client, now=now)
            # that it is armed may not have been heard yet: the stream passes when it is
            is_withheld = self.tasks.is_driving or self.control.is_engaged
            if self.persona.arms_in_hold and streams and not is_withheld:
                # the vehicle enters that mode only in a stream, of which it has not heard yet
                self.requests.send_zero()
                self.requests.send_zero()
            return
        if self.control.is_taking:
            self._take_over(f"client asks for {self.persona.mode_name(mode)}", now=now)

    def is_armed_by_client(self, *, now: float) -> bool:
        """Whether a client has asked for arming, through us, just now."""
        return self._authority.armed_by_client(now=now)

    def forget_start(self) -> None:
        """The mission that was to begin when it is armed is another one now, or is not wanted."""
        self.start_mark.remove()
        self.shown.forget()

    def forget_start_of(self, keys: AbstractSet[str]) -> None:
        """What such a key wanted to begin with the arming is not wanted any more."""
        marker = self.start_mark.marker
        if marker is not None and marker.submitter.key in keys:
            self.forget_start()

    def check_not_by_hand(self, *, now: float) -> None:
        """Raise Rejection while a person drives: in the mode for that, armed, and moving."""
        if not (self.armed and self.is_by_hand):
            return
        if self._authority.since_other(now=now) < self._settings.watch.other_controller:
            raise Rejection(TaskReason.OTHER_CONTROLLER, "somebody is at the sticks")
        if not self.where.motion.is_still(now=now):
            raise Rejection(TaskReason.WRONG_MODE, "driven by hand: it must stand first")

    def leave_manual(self, *, now: float) -> None:
        """A client starts a mission: as on an autopilot, that ends driving by hand.

        By way of HOLD, from which tasks take the vehicle.
        """
        if self.armed and self.is_by_hand and not self.control.is_engaged:
            self.control.begin_release(now=now)
            self.requests.flush(now=now)
            self._clock.restart(now=now)

    def may_move(self, client: Hashable) -> bool:
        """Whether a client's motion message may pass."""
        return not self.why_not_moved(client)

    def why_not_moved(self, client: Hashable) -> str:
        """Give in words what keeps a client's motion message from passing, "" if nothing does."""
        why_not = self.why_no_motion()
        if why_not:
            return why_not
        if self.tasks.is_driving:  # also one that is paused
            return "not while tasks drive"
        if not self.armed:
            return "the rover is not armed"
        if not self._authority.has_granted(client):
            return f"ask for {self.persona.mode_name(self.persona.control_mode)} first"
        return ""

    def why_no_motion(self) -> str:
        """Return in words why nobody else may have it move now, "" if somebody may."""
        if self.tasks.is_stopped:
            return "STOP is latched"
        if self.control.is_engaged:
            return "not while tasks drive"
        if self.control.awaits_mode:
            return "HOLD is being asked for"
        return ""

    def is_not_moved_by(self, client: Hashable, *, now: float) -> None:
        """A client's motion message does not go to it."""
        self._authority.note_withheld(client, now=now)

    def has_granted(self, client: Hashable) -> bool:
        """Whether a client may move it, as far as that is the client's doing."""
        return self._authority.has_granted(client)

    def client_is_gone(self, client: Hashable, *, now: float) -> None:
        """Its connection has ended: what it drove stands, and does not wait for its own watch."""
        had_control = self._authority.forget(client)
        is_driven = self._authority.since_other(now=now) < self._settings.watch.other_controller
        is_free = not self.control.is_engaged and not self.persona.has_loss_failsafe
        if had_control and is_driven and is_free:
            self.requests.send_zero()

    def is_moved_by(self, client: Hashable, *, now: float) -> None:
        """A client's motion message goes to it: tasks wait."""
        self._authority.note_client(client, now=now)

    def end_driving_of(self, client: Hashable, *, now: float) -> None:
        """A client asks for a return, a place or a mission: its own setpoints end with that.

        What it drove stands, so that neither its last velocity nor a failsafe for lost setpoints
        comes before what it asks for now.
        """
        if client is None or self._driver(now=now) != client:
            return
        self._authority.revoke()
        if self.control.is_engaged:
            return
        if self.persona.has_loss_failsafe:
            self.control.begin_release(now=now)
            self.requests.flush(now=now)
            self._clock.restart(now=now)
        else:
            self.requests.send_zero()
            self.requests.send_zero()  # one may be lost

    def stand_down(self, client: Hashable, *, now: float) -> None:
        """A client has landed it: disarm it once no task is left to drive.

        Raise Rejection under STOP, and while a person drives.
        """
        if self.tasks.is_stopped:
            raise Rejection(TaskReason.STOPPED, "STOP is latched: continue first")
        self.check_not_by_hand(now=now)
        self.end_driving_of(client, now=now)
        self.control.disarm_at_end()
        if self.armed and self.tasks.is_idle and not self.control.is_engaged:
            self.control.begin_release(now=now)
            self.requests.flush(now=now)
            self._clock.restart(now=now)

    def _driver(self, *, now: float) -> Hashable:
        """The client whose setpoints the vehicle may still follow, or None."""
        return self._authority.driver(within=self._settings.watch.other_controller, now=now)

    def sticks_moved(self, *, now: float) -> None:
        """A person drives by hand: one last zero if the vehicle still follows us, then nothing.

        One that takes a stick for a speed in our mode gets HOLD: there nobody can steer it.
        """
        self._authority.note_other(now=now)
        if self.persona.heeds_throttle_stick and self.control.is_engaged:
            self._stick_moved(now=now)
            return
        self._zero_what_is_kept()
        self._take_over("driven by hand", now=now)

    def _stick_moved(self, *, now: float) -> None:
        """A person holds a stick, of a transmitter or a station, and the vehicle may drive by it.

        In our mode nobody can steer by sticks, and zeros do not stop it. HOLD does; but one that
        rolls on in HOLD first brakes by set-points against the stick.
        """
        phase = self.control.phase
        if phase in (Phase.STOPPING, Phase.RELEASING) or self.tasks.is_stopped:
            return
        if self.tasks.paused in TAKEN and self._guard.ladder.is_on:
            return  # and is being stopped for that
        self._note("has a stick off centre: HOLD. Centre it", now=now)
        self._authority.note_other(now=now)
        self.tasks.pause(TaskReason.TAKEOVER, actor=f"vehicle {self.system_id}", now=now)
        if (
            self.persona.brakes_by_setpoints
            and self._sticks.throttle(now=now)
            and self._guard.is_fresh(now=now)
        ):
            self.step(now=now)
        else:
            self.control.begin_release(now=now)
        self._guard.ladder.begin(now=now)
        self.requests.flush(now=now)
        self._clock.restart(now=now)

    def second_controller(self, who: Address, *, now: float) -> None:
        """Setpoints or an address like ours, not from us: HOLD once, then let go."""
        if self._authority.since_other(now=now) > self._settings.watch.other_controller:
            self._note(f"second controller {who}", now=now)
            self.tasks.halt(TaskReason.OTHER_CONTROLLER, actor=str(who), now=now)
        self._authority.note_other(now=now)
        if self.control.phase is Phase.STOPPING:
            return
        if self.control.is_engaged:
            if self.persona.has_loss_failsafe:  # which a zero would end, if HOLD is of that
                self.requests.send_hold()
            self.requests.send_zero()
            if not self.persona.has_loss_failsafe:
                self.requests.send_hold()
        if self.tasks.begun is not None or self.control.is_engaged:
            self._take_over(f"second controller {who}", now=now)

    def go_to_follows(self, number: int, *, actor: str, now: float) -> None:
        """A client's "go to" is stored: a HOLD of it just before was none."""
        is_still = self.hold_before.is_still(number)
        if not is_still or self.tasks.paused is not TaskReason.OPERATOR:
            return
        try:
            self.go_on(actor=actor, now=now)
        except Rejection as refusal:
            self._note(f"stays paused: {refusal.text}", now=now)

    def stop(self, *, clear: bool, actor: str, now: float) -> TaskId | None:
        """STOP: zero and HOLD leave in this very step."""
        self._take_back()
        self.stopped_at = now
        killed = self.tasks.stop(clear=clear, actor=actor, now=now)
        self._begin_stop(now=now)
        return killed

    def _begin_stop(self, *, now: float, brakes: bool = True) -> None:
        self._face(now=now)
        brakes = brakes and self.persona.brakes_by_setpoints and self._guard.is_fresh(now=now)
        longest = self._settings.watch.shutdown - 1.0 if self._is_closing else BRAKES_FOR
        self.control.begin_stop(now=now, brake_for=longest if brakes else 0.0)
        self._guard.ladder.begin(now=now)
        self.requests.end_performing()
        self._clock.restart(now=now)
        self.requests.flush(now=now)

    def hold(self, *, sender: Hashable, actor: str, now: float) -> TaskId | None:
        """A client wants HOLD: zeros and the mode at once; a task and its queue pause.

        Where it may belong to a "go to" that follows, zeros at once, and the mode a little later.
        """
        self.tasks.halt(TaskReason.OPERATOR, actor=actor, now=now)
        if self.tasks.is_stopped:
            self._begin_stop(now=now)
            return None
        self._take_back(is_hold=True)
        was_paused, paused = self.tasks.paused, None
        if not self.tasks.is_empty:
            paused = self.tasks.pause(TaskReason.OPERATOR, actor=actor, now=now)
        if self.persona.is_held_before_places and self.control.phase is Phase.CONTROL:
            self.hold_before.note(sender, has_paused=not was_paused, now=now)
            self.step(now=now)
            return paused
        self.hold_before.forget()
        self.control.begin_release(now=now)
        self.requests.flush(now=now)
        self._clock.restart(now=now)
        return paused

    def cancel(self, task: Task, *, kill: bool, actor: str, now: float) -> None:
        """Call a task off; if it is the begun one, zeros leave in this very step."""
        self.hold_before.forget()
        self.forget_start()
        begun = self.tasks.begun
        is_begun = begun is not None and begun.id == task.id
        self.tasks.cancel(task, kill=kill, reason=TaskReason.CANCELLED, actor=actor, now=now)
        if is_begun:
            self._authority.revoke()  # who wants to drive now must ask again
            self.step(now=now)

    def clear(self, *, begun_too: bool, actor: str, now: float) -> None:
        """Call off what waits, or everything."""
        self.hold_before.forget()
        self.forget_start()
        self.tasks.clear(begun_too=begun_too, actor=actor, now=now)
        if begun_too:
            self.tasks.halt(TaskReason.CLEARED, actor=actor, now=now)
            self.end_driving_of(self._driver(now=now), now=now)
            self._take_back()
        if begun_too and self.control.is_engaged:
            self.step(now=now)

    def modify(self, task: Task, terms: Terms, *, actor: str, now: float) -> None:
        """Change the terms of a task."""
        self.tasks.modify(task, terms, actor=actor, now=now)

    def release(
        self, task: Task, *, again: bool, may_continue: bool, actor: str, now: float
    ) -> None:
        """Let a held task go on; raise Rejection while it could not take the vehicle.

        After a restart of the vehicle this is a person's word that all is well, and restores
        the permission to arm if the person may give it (``may_continue``). What somebody has
        disarmed stays so until a continue.
        """
        seen = self.view(now=now)
        restores = may_continue and self._authority.is_withdrawn_by_restart
        if restores:
            seen = replace(seen, may_arm=self._authority.may_arm_again)
        self.tasks.release(
            task, again=again, may_continue=may_continue, seen=seen, actor=actor, now=now
        )
        if restores:
            self._restore_arming(now=now)
        self.wake(now=now)

    def skip(self, task: Task, *, actor: str, now: float) -> None:
        """End a held task."""
        self.tasks.cancel(task, kill=False, reason=TaskReason.SKIPPED, actor=actor, now=now)
        self._authority.revoke()
        self.wake(now=now)

    def run_now(self, draft: Draft, *, actor: str, now: float) -> Task:
        """Take a task in that runs at once, before what runs and what waits."""
        self.hold_before.forget()
        task = self.tasks.run_now(draft, self.view(now=now), actor=actor, now=now)
        self.step(now=now)
        return task

    def operator_lost(self, *, now: float) -> None:
        """No ground station is heard any more: nothing runs unseen, nor begins."""
        self.tasks.forget_release()
        self.forget_start()
        begun = self.tasks.begun
        is_running = begun is not None and begun.state in RUNNING
        goes_on = is_running or self._goes_on_by_itself or self.tasks.urgent is not None
        if self.tasks.is_empty or (self.tasks.paused and not goes_on):
            return
        self._note("no ground station is heard: paused", now=now)
        self.pause(actor=SERVER, now=now)

    def pause(self, *, actor: str, now: float) -> TaskId | None:
        """Let task and queue stand, also when there is no task; zeros leave in this very step.

        A vehicle that moves without a task is stopped as by HOLD; so is one that was taken over.
        """
        self._take_back()
        begun = self.tasks.begun
        is_driven = begun is not None and begun.reason not in TAKEN
        paused = self.tasks.pause(TaskReason.OPERATOR, actor=actor, now=now)
        if not is_driven and self.armed and not self.control.is_engaged:
            self.hold(sender=None, actor=actor, now=now)
        else:
            self.step(now=now)
        return paused

    def pause_tasks(self, *, now: float) -> None:
        """Let task and queue stand, and not what else may move the vehicle."""
        self.hold_before.forget()
        self.forget_start()
        self.tasks.pause(TaskReason.OPERATOR, actor=SERVER, now=now)
        self.step(now=now)

    def proceed(self, *, actor: str, now: float) -> TaskId | None:
        """Release STOP, takeover and pause; arming is allowed again. A held task stays held.

        Raise Rejection, and change nothing, while the begun task could not take the vehicle.
        """
        self.hold_before.forget()
        may_arm = self._authority.may_arm_again
        seen = replace(self.view(now=now), may_arm=may_arm)
        allows = may_arm and not self._authority.may_arm
        going_on = self.tasks.proceed(seen, allows=allows, actor=actor, now=now)
        self._restore_arming(now=now)
        held = self.tasks.held
        if held is not None:
            self._note(f"has task {held.id} on hold: release it ({BUTTONS})", now=now)
        self.wake(now=now)
        return going_on

    def go_on(self, *, actor: str, now: float) -> None:
        """End a pause, as ``proceed``, but nobody has said that the vehicle may be armed again."""
        self.tasks.proceed(self.view(now=now), actor=actor, now=now)
        self.wake(now=now)

    def shut_down(self, *, now: float) -> None:
        """The server ends: pause what is begun and stop what we drive; nothing begins any more."""
        self._is_closing = True
        begun = self.tasks.begun
        self._stops_task = begun is not None and begun.state in RUNNING
        if begun is not None:
            self.tasks.pause(TaskReason.OPERATOR, actor=SERVER, now=now)
        if self.control.is_engaged:
            self._begin_stop(now=now)

    def note_rest(self, *, now: float) -> None:
        """The server ends now: keep where what it has stopped has come to."""
        if self._stops_task:
            self.tasks.rest(self.view(now=now), now=now)

    # time

    def next_deadline(self) -> float:
        """Give when ``handle_deadline`` has something to do."""
        deadline = min(self._clock.next_at, self.requests.next_deadline() or inf)
        if not self._was_heard:  # nothing is asked of one that cannot answer
            return deadline
        silent_at = self._monitor.heard_at + self._settings.watch.heartbeat_lost + 1e-3
        return min(deadline, self.requests.intervals.next_deadline(), silent_at)

    def handle_deadline(self, *, now: float) -> None:
        """Do what is due: the setpoint tick, repeats, rates, silence."""
        fell_silent = self._was_heard and not self.is_heard(now=now)
        if fell_silent:
            self._was_heard = False
            self._note("silent", now=now)
        if now >= self._clock.next_at or fell_silent:
            self.step(now=now)  # first: what is late may make a request pointless
        self.requests.handle_deadline(now=now)
        self.requests.flush(now=now)
        self._ask_for_rates(now=now)

    def wake(self, *, now: float) -> None:
        """Look at the tasks unless that is about to be done: another may be ready now."""
        if not self._clock.is_running:
            self.step(now=now)

    def step(self, *, now: float) -> None:
        """Let the tasks say what they demand, and do it."""
        self._face(now=now)
        seen = self.view(now=now)
        begun_before = self.tasks.begun
        demand = STOP if self._is_closing else self.tasks.step(seen, now=now)
        self._is_back_home = self._is_back_home and self.tasks.begun is None
        if begun_before is not None and self.tasks.begun is None:
            self._authority.revoke()
            self._note_end(self._book[begun_before.id])
            if self._book[begun_before.id].reason is TaskReason.STUCK:
                self.where.motion.doubt(until=now + UNSEEN_STOP)
                seen = replace(seen, still=False)
        self._follow(demand, seen, now=now)
        self._guard_motion(demand, seen, now=now)
        if self.requests.flush(now=now):
            self.tasks.setpoint_left(now=now)
        self._plan_tick(now=now)

    def _face(self, *, now: float) -> None:
        """Tell its control what decides how it is asked to stand."""
        motion = self.where.motion.latest()
        is_known = motion is not None and now - motion.at <= self._settings.watch.position_lost
        yaw = motion.pose.yaw if motion is not None and is_known else None
        persona = self.persona
        rolls = persona.brakes_by_speed_loop and self._guard.brakes(
            rolls_out=persona.rolls_out, now=now
        )
        self.control.posture = Posture(yaw, rolls=rolls, stick=self._sticks.throttle(now=now))

    def _guard_motion(self, demand: Demand, seen: VehicleView, *, now: float) -> None:
        """See that it stands when it is told to, and drives no faster than it is told to."""
        control, wanted = self.control, ZERO
        if demand.kind is DemandKind.DRIVE:
            wanted = demand.velocity
        told = Told(
            forward=wanted.forward,
            moves=control.in_control and not wanted.is_zero,
            is_ours=control.in_control or control.phase in (Phase.RELEASING, Phase.STOPPING),
            is_stopping=control.phase is Phase.STOPPING,
            rolls_out=self.persona.rolls_out,
            may_drive=control.in_control and not self.tasks.is_stopped,
            goes_on=demand.kind in (DemandKind.TAKE, DemandKind.DRIVE),
            is_released=not control.is_engaged,
            is_held=self._monitor.custom_mode == self.persona.hold_mode,
            armed=self.armed,
            still=seen.still,
            heard=seen.heard,
        )
        for found in self._guard.look(told, now=now):
            self._take_measure(found, demand, now=now)

    def _take_measure(self, found: Found, demand: Demand, *, now: float) -> None:
        match found.measure:
            case Measure.HOLD_NOW if self.control.in_control:
                self.control.begin_release(now=now)
            case Measure.HOLD_NOW:
                self.control.hold_now(now=now)
            case Measure.DISARM:
                self._note(found.words, now=now)
                self.control.disarm_now(now=now)
            case Measure.STOP_TASK:
                begun = self.tasks.begun
                if begun is not None and begun.state is TaskState.EXECUTING:
                    self._note(found.words, now=now)
                    self.tasks.hold(TaskReason.OVERSPEED, now=now)
                    self._begin_stop(now=now, brakes=False)  # which a held stick would defeat
            case Measure.HOLD if demand.kind in (DemandKind.TAKE, DemandKind.DRIVE):
                self._note("moves though it is told to stand: HOLD", now=now)
                self.tasks.hold(TaskReason.STOP_UNCONFIRMED, now=now)
                self._begin_stop(now=now)
            case Measure.HOLD if self.control.phase is Phase.STOPPING:
                self.control.hold_now(now=now)
            case Measure.HOLD if self.control.in_control:
                self.control.begin_release(now=now)

    def _note_end(self, ended: Task) -> None:
        """A return has ended: as on an autopilot that has landed, whoever armed it is done."""
        self._is_back_home = ended.state is TaskState.COMPLETED and ends_at_home(ended.goal)
        if self._is_back_home:
            self.control.disarm_at_end()

    def check_late(self, *, now: float) -> None:
        """What drove on without us for too long stops, and somebody looks at it first.

        What came in meanwhile looks fresh and is not, so nothing is steered by it.
        """
        begun = self.tasks.begun
        late = self._clock.lateness(now=now) > self._settings.watch.late_tick
        if late and begun is not None and begun.state is TaskState.EXECUTING:
            if self.persona.has_loss_failsafe:  # a zero alone would end it
                self.control.begin_release(now=now)
                self.requests.flush(now=now)
            else:
                self.requests.send_zero()
            self.tasks.setpoint_left(now=now)  # that it came late shows in what holds the task
            self.tasks.hold(TaskReason.LATE, now=now)

    def _plan_tick(self, *, now: float) -> None:
        if self.control.is_engaged or self.tasks.begun is not None or self._guard.ladder.is_on:
            self._clock.plan(now=now)
        else:
            self._clock.stop()

    def view(self, *, now: float) -> VehicleView:
        """Give one look at the vehicle for the task domain."""
        watch = self._settings.watch
        return VehicleView(
            heard=self.is_heard(now=now),
            mode=self._authority.kind_of(self._monitor.custom_mode, armed=self._monitor.armed),
            is_booting=self._monitor.custom_mode == self.persona.booting_mode,
            armed=self._monitor.armed,
            may_arm=self._authority.may_arm,
            in_control=self.control.in_control,
            refusal=REFUSALS[self.control.refused],
            is_not_ready=self.control.is_not_ready,
            why_not_ready=self._failsafes.why_not_ready(now=now),
            motion=self.where.motion.latest(),
            still=self.where.motion.is_still(now=now),
            other_controller=self._authority.since_other(now=now) < watch.other_controller,
            frame=self.where.frame.frame(),
            home=self.where.home,
            is_fence_unknown=self.where.is_fence_unknown,
            is_outside_own_fence=self._failsafes.is_outside_fence,
            honours_yaw_rate=self.persona.honours_yaw_rate,
            turning=self.persona.turning,
            turns_by_course=self.persona.turns_by_course,
            turning_radius=self.persona.turning_radius or self._settings.driving.turning_radius,
            is_unknown=self.tasks.has_uid and not self.requests.is_identified,
            drives_on=self.may_drive_on,
        )

    def apply(self, settings: Settings) -> None:
        """Take new settings, but for those that need a restart: see the table of keys."""
        self._settings = settings
        self._monitor.lost_after = settings.watch.heartbeat_lost
        self.where.motion.apply(settings.watch)
        self._guard.apply(settings.watch)
        self.requests.apply(settings.watch)
        self.known.apply(settings.profiles, self.system_id)  # used from the next heartbeat on

    def _follow(self, demand: Demand, seen: VehicleView, *, now: float) -> None:
        match demand.kind:
            case DemandKind.TAKE:
                self.control.take(may_arm=seen.may_arm, now=now)
            case DemandKind.DRIVE:
                wanted = demand.velocity
                if not wanted.is_zero:
                    self.where.motion.standstill.may_move()
                self.control.drive(Speeds(wanted.forward, wanted.yaw_rate, wanted.course))
            case DemandKind.HOLD:
                still = seen.still and not self.hold_before.is_open(now=now)
                slows, disarm = self._guard.ladder.is_slowing(now=now), self._is_back_home
                self.control.release(still=still, disarm=disarm, now=now, is_slowing=slows)
            case DemandKind.HAND_BACK:
                slows = self._guard.ladder.is_slowing(now=now)
                self.control.release(still=seen.still, disarm=True, now=now, is_slowing=slows)
            case DemandKind.HALT if self.control.phase is not Phase.STOPPING:
                self._begin_stop(now=now)
            case DemandKind.STOP | DemandKind.HALT:
                self.control.stop(still=seen.still, heard=seen.heard, now=now)

    def _ask_for_rates(self, *, now: float) -> None:
        if self._was_heard:  # nothing is asked of one that cannot answer
            self.requests.ask_which(now=now)
            if self.tasks.has_uid and self.requests.has_not_said_which(now=now):
                self.tasks.unidentified(now=now)
            self.requests.ask_for_rates(now=now)

    def _note(self, text: str, *, now: float) -> None:
        self._book.record(VehicleNoted(self.system_id, text, now))
