"""Handles mode requests: HOLD, return and mission by the server, other modes by the vehicle.

A request comes as DO_SET_MODE, which is answered, or as the older message SET_MODE, which has no
acknowledgement: its sender waits until a heartbeat shows the mode.
"""

from dataclasses import dataclass
from functools import partial

from mav_tasks.basics.errors import Rejection
from mav_tasks.engine.clients.gcs_side import GcsSide
from mav_tasks.engine.clients.refusals import Refusals
from mav_tasks.engine.clients.rights import Rights
from mav_tasks.engine.commands.command_request import CommandRequest, MessageRequest
from mav_tasks.engine.commands.ordering import note_halt, require_newer
from mav_tasks.engine.commands.submissions import Submissions, give_back
from mav_tasks.engine.missions.plans import MISSION, Plans
from mav_tasks.engine.policy import Kind, row_of_command
from mav_tasks.engine.vehicles.parts import Starter
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.kinds import GoTo
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.enums import MavCmd, MavResult, MavSeverity
from mav_tasks.tasks.goal import Plan
from mav_tasks.tasks.lifecycle import CONTINUE_FIRST, TaskReason
from mav_tasks.tasks.task import Draft, Submitter, Terms

R = TaskReason

START_WITHIN = 10.0  # s, in which the arming must come that starts a mission
SHOWN_FOR = 1.2  # s, in which heartbeats at 1 Hz show a mode at least once
CRUISING = Terms(is_cruising=True)


@dataclass(repr=False, eq=False)
class ModeRequests:
    """The handler of mode requests and mission starts of all clients."""

    _gcs: GcsSide
    _submissions: Submissions
    _plans: Plans
    _refusals: Refusals

    def asked(self, asked: CommandRequest, *, now: float) -> bool:
        """Handle DO_SET_MODE. Return False if the vehicle itself is to answer it."""
        vehicle, client = asked.vehicle, asked.client
        main, sub = asked.command.params[1:3]
        mode = vehicle.persona.mode_in(main, sub)
        if mode is None:
            raise Rejection(R.BAD_PARAMETER, f"param2 {main:g} is not a mode number")
        if mode == vehicle.persona.hold_mode:
            self._submissions.held(vehicle, asked.submitter)
            paused = vehicle.joint.hold(sender=asked.sender, actor=asked.actor, now=now)
            if not vehicle.is_heard(now=now):
                raise Rejection(
                    R.VEHICLE_SILENT, f"HOLD requested, but rover {vehicle.system_id} is silent"
                )
            asked.answer(MavResult.ACCEPTED, paused or 0)
            return True
        if vehicle.tasks.is_stopped:
            raise Rejection(R.STOPPED, CONTINUE_FIRST)
        is_return = mode == vehicle.persona.return_mode and vehicle.parts.settings.claim
        if is_return and vehicle.where.home is not None:
            home, command = GoTo(None), MavCmd.NAV_RETURN_TO_LAUNCH
            draft = Draft(vehicle.system_id, command, home, asked.submitter, CRUISING, asked.marks)
            self._submissions.run_now(asked, draft, now=now)
            self._show(vehicle, mode, now=now)
            return True
        if not self._is_mission(vehicle, mode):
            role = row_of_command(MavCmd.DO_SET_MODE).role
            asked.rights.require(role, "change the mode", moves=True)
            vehicle.joint.client_asks_mode(mode, client.key, now=now)
            return False
        self._plans.check_start(asked.rights, vehicle, asked.submitter)
        if vehicle.persona.starts_when_armed and not vehicle.armed:
            self._mark(asked, now=now)
            shown = self._plans.shown(vehicle)
            asked.answer(MavResult.ACCEPTED, 0 if shown is None else shown.id)
        else:
            self.start_plan(asked, first=0, now=now)
            self._show(vehicle, mode, now=now)
        return True

    def heard(self, asked: MessageRequest, *, now: float) -> None:
        """Handle the message SET_MODE."""
        vehicle = asked.vehicle
        epoch = vehicle.tasks.halts.epoch
        try:
            if asked.kind is Kind.GO:
                require_newer(asked, now=now)
            if not self.asked(asked, now=now):
                vehicle.requests.forward(asked.packet)
                vehicle.requests.ask_to_show(now=now)
        except Rejection as refusal:
            if self._refusals.message(
                asked.client, vehicle.system_id, asked.packet, refusal, now=now
            ):
                asked.client.tell_refusal(refusal.text, vehicle.server_address, now=now)
        note_halt(asked, before=epoch)

    # missions

    def start_plan(self, asked: CommandRequest, *, first: int, now: float) -> None:
        """Start or resume the uploaded mission; after its end it is submitted as a new task."""
        vehicle, submitter = asked.vehicle, asked.submitter
        self._plans.check_start(asked.rights, vehicle, submitter)
        self._submissions.check_open()
        vehicle.joint.end_driving_of(asked.client.key, now=now)
        started = self._plans.start(asked.rights, vehicle, submitter, first=first, now=now)
        if isinstance(started, Draft):
            task = self._submissions.submit_draft(asked, started, now=now)
            self._plans.restarted(asked.rights, vehicle, task, now=now)
        else:
            task, undo = started
            words = "not stored in time: not started"
            then = partial(give_back, asked, task.id)
            self._submissions.answer_once_durable(
                asked, task.id, words, undo=undo, then=then, now=now
            )

    def look_for_arming(self, vehicle: Vehicle, *, now: float) -> None:
        """Start the mission of a vehicle that was to be armed first and is armed now."""
        parts = vehicle.parts
        starter = parts.start.holder(now=now)
        if starter is None or not parts.is_armed(now=now):
            return
        if vehicle.control.is_engaged or vehicle.control.we_armed:
            return  # armed by the server, for a task
        parts.forget_start()
        if starter.plan_id != self._plans.stored(vehicle.system_id, MISSION).plan_id:
            return
        if parts.is_manual and not parts.armings.are_by_client(now=now):
            return  # armed by a person who means to drive
        try:
            self._start_unasked(vehicle, starter.submitter, starter.rights, now=now)
        except Rejection as refusal:
            self._gcs.tell(refusal.text, MavSeverity.WARNING, vehicle.server_address, now=now)

    def _start_unasked(
        self, vehicle: Vehicle, submitter: Submitter, rights: Rights, *, now: float
    ) -> None:
        self._submissions.check_open()
        started = self._plans.start(rights, vehicle, submitter, first=0, now=now)
        if isinstance(started, Draft):
            task = self._submissions.take_in(rights, vehicle, started, now=now)
            self._plans.restarted(rights, vehicle, task, now=now)
        self._show(vehicle, vehicle.persona.mission_mode, now=now)

    def _mark(self, asked: CommandRequest, *, now: float) -> None:
        vehicle = asked.vehicle
        plan_id = self._plans.stored(vehicle.system_id, MISSION).plan_id
        starter = Starter(asked.submitter, asked.rights, plan_id)
        vehicle.parts.start.give(starter, until=now + START_WITHIN)
        asked.tell("The mission starts when the rover is armed", MavSeverity.INFO, now=now)
        self._show(vehicle, vehicle.persona.mission_mode, now=now)

    def _show(self, vehicle: Vehicle, mode: int, *, now: float) -> None:
        """Show clients a mode at once: SET_MODE has no other answer."""
        lasts = SHOWN_FOR if vehicle.parts.start.holder(now=now) is None else START_WITHIN
        vehicle.shown.mode.give(mode, until=now + lasts)
        heartbeat = vehicle.shown.in_message(vehicle.parts.monitor.latest, mode)
        source = Address(vehicle.system_id, AUTOPILOT)
        for client in self._gcs.clients:
            if vehicle.system_id in client.introduced:
                client.outlet.send(heartbeat, source)

    def _is_mission(self, vehicle: Vehicle, mode: int) -> bool:
        """Whether the server drives this mode itself, as the mission uploaded to it."""
        active = vehicle.tasks.active
        has_plan = bool(self._plans.stored(vehicle.system_id, MISSION).source)
        has_plan = has_plan or (active is not None and isinstance(active.goal, Plan))
        return mode == vehicle.persona.mission_mode and has_plan and vehicle.parts.settings.claim
