"""One vehicle: dispatches its messages and requests to the parts that decide about it.

``joint`` decides who may move it, ``pilot`` what drives it. ``takeovers`` detects what others have
done to it. ``commands.forwarding`` decides whether a client's set-points pass.
"""

from collections import OrderedDict
from collections.abc import Hashable
from math import inf
from typing import Any, NamedTuple

from mav_tasks.config.settings import Settings
from mav_tasks.engine.clients.sender import Sender
from mav_tasks.engine.packets import LeaseWatch, PacketSender
from mav_tasks.engine.policy import Kind, row_of_command
from mav_tasks.engine.services.commands import COPIED, DOUBLED, Standing
from mav_tasks.engine.services.persona import Persona
from mav_tasks.engine.services.vehicle_status import (
    HeartbeatMonitor,
    charge_of,
    identity_of,
    kind_of,
    uid_of,
)
from mav_tasks.engine.vehicles.authority import ANY_MODE, Authority, Before
from mav_tasks.engine.vehicles.control import Event
from mav_tasks.engine.vehicles.joint_control import JointControl, Word
from mav_tasks.engine.vehicles.parts import Parts
from mav_tasks.engine.vehicles.pilot import Pilot
from mav_tasks.engine.vehicles.self_description import SelfDescription
from mav_tasks.engine.vehicles.sender_clock import Heard, Stamped
from mav_tasks.engine.vehicles.shown import ShownHeartbeat
from mav_tasks.engine.vehicles.takeovers import Takeovers
from mav_tasks.engine.vehicles.vehicle_position import VehiclePosition
from mav_tasks.engine.vehicles.vehicle_requests import ActKey, VehicleRequests
from mav_tasks.kinds import Act
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.enums import MavCmd, MavFrame
from mav_tasks.mavlink.packet import Packet
from mav_tasks.tasks.halts import LastHalt, Permit
from mav_tasks.tasks.lifecycle import RUNNING, TaskReason
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.vehicle_tasks import VehicleTasks
from mav_tasks.tasks.view import VehicleView

PLACES = 4  # component ids that the server may use, from the configured one on


class Components:
    """The components heard in one vehicle's system, among them the autopilot."""

    def __init__(self, system_id: int, *, first: int) -> None:
        self._heard: set[int] = set()
        self._places = [Address(system_id, first + number) for number in range(PLACES)]
        #: the task server's address inside this vehicle's system
        self.server = self._places[0]
        self.note(AUTOPILOT)

    def __contains__(self, component_id: int) -> bool:
        return component_id in self._heard

    def note(self, component_id: int) -> bool:
        """Note a component that was heard. Return whether the server's address changes by it."""
        before = self.server
        self._heard.add(component_id)
        free = (place for place in self._places if place.component_id not in self._heard)
        self.server = next(free, self._places[0])
        return self.server != before


REMEMBERED = 1024  # packets
PRESENT = 3.0  # s since its last packet, in which a sender counts as present


class _Said(NamedTuple):
    sender: Sender
    epoch: int  # the vehicle's halt epoch when the first copy came
    at: float  # s, when the last copy came


class GoWords:
    """The memory of such packets."""

    def __init__(self) -> None:
        self._said: OrderedDict[bytes, _Said] = OrderedDict()

    def __repr__(self) -> str:
        return f"GoWords({len(self._said)})"

    def first_epoch(self, packet: bytes, sender: Sender, *, now: float) -> int | None:
        """Return the halt epoch at which this packet first came elsewhere, or None if it did not.

        If its first sender is gone, the packet counts as a copy for COPIED s only: a restarted
        program sends the same bytes from another port.
        """
        said = self._said.get(packet)
        if said is None or said.sender is sender:
            return None
        within = DOUBLED if now - said.sender.line.heard_at <= PRESENT else COPIED
        return said.epoch if now - said.at <= within else None

    def says(self, packet: bytes, sender: Sender, *, epoch: int, now: float) -> None:
        """Remember a packet; its first sender stays its sender."""
        before = self._said.pop(packet, None)
        is_known = before is not None and now - before.at <= DOUBLED
        who = before.sender if before is not None and is_known else sender
        self._said[packet] = _Said(who, epoch, now)
        if len(self._said) > REMEMBERED:
            self._said.popitem(last=False)


REORDERED = 127  # packets by which a network may reorder one, as far as numbers can show
SILENT = 0.5  # s without any packet of the autopilot
REORDERED_WITHIN = 3.5  # s; after a longer silence a smaller number means a restart
MOVING = frozenset({Kind.GO, Kind.MOTION, Kind.ACTION})
FORCED = 21196.0  # COMPONENT_ARM_DISARM, param2: an emergency stop


class Vehicle:
    """The vehicle with one system id, at one endpoint of a vehicle link."""

    def __init__(
        self,
        system_id: int,
        *,
        heartbeat: m.Heartbeat,
        persona: Persona,
        outlet: PacketSender,
        registry: TaskRegistry,
        tasks: VehicleTasks,
        settings: Settings,
        lease: LeaseWatch,
        may_arm: bool,
        now: float,
    ) -> None:
        requests = VehicleRequests(
            Address(system_id, AUTOPILOT),
            persona,
            outlet,
            source=Address(settings.identity.system_id, settings.identity.component_id),
            halts=tasks.halts,
            watch=settings.watch,
            now=now,
        )
        monitor = HeartbeatMonitor(heartbeat, lost_after=settings.watch.heartbeat_lost, now=now)
        self.parts = parts = Parts(
            system_id,
            persona,
            registry,
            tasks,
            requests,
            VehiclePosition(settings.watch, tasks.bounds),
            monitor,
            Authority(persona, tasks.halts, may_arm=may_arm),
            settings,
            lease,
            Permit(tasks.halts),
            Permit(tasks.halts),
            Permit(tasks.halts),
            ShownHeartbeat(tasks.halts),
        )
        self.system_id = system_id
        self.tasks, self.requests, self.control = tasks, requests, requests.control
        self.where, self.shown = parts.where, parts.shown
        self._monitor = monitor
        self.pilot = Pilot(parts, self.view)
        self.joint = JointControl(parts, self.pilot, self.view)
        self._takeovers = Takeovers(parts, self.joint)
        self._clock = self.pilot.clock
        self.last_heartbeat: Packet | None = None
        self.last_seq = 0  # sequence number of the autopilot's last packet
        self._number = 0  # the same, counted on beyond 255
        #: when that packet came, s
        self.counted_at = -inf
        self._last_beat = (0, -inf)  # number and time of the last heartbeat
        self._overtaken: tuple[m.Heartbeat | None, float] = (None, -inf)  # the last such heartbeat
        self._was_heard = True
        #: the charge that is left, 0 to 1; None: not known
        self.battery: float | None = None
        #: recent packets that let the vehicle go, from all endpoints
        self.go_words = GoWords()
        self._says = SelfDescription(parts)
        self.components = Components(system_id, first=settings.identity.component_id)
        #: the task server's address inside this vehicle's system
        self.server_address = self.components.server
        self.control.heard(armed=monitor.armed, mode=monitor.custom_mode, now=now)

    def __repr__(self) -> str:
        return f"Vehicle({self.system_id}, {self.control!r}, {self.tasks!r})"

    @property
    def persona(self) -> Persona:
        """The persona: how this autopilot must be spoken to."""
        return self.parts.persona

    @property
    def server_component(self) -> int:
        """The component id under which the task server appears inside this vehicle's system."""
        return self.server_address.component_id

    @property
    def armed(self) -> bool:
        """Whether the vehicle was last seen armed."""
        return self._monitor.armed

    @property
    def heard_at(self) -> float:
        """When its last heartbeat came, s."""
        return self._monitor.heard_at

    def is_heard(self, *, now: float) -> bool:
        """Return whether its last heartbeat is recent."""
        return now - self._monitor.heard_at <= self._monitor.lost_after

    def count(self, seq: int, *, now: float) -> None:
        """Note the sequence number of a packet of its autopilot.

        After a silence it counts as ahead, however many were lost: no packet is that late.
        """
        behind = 0 if now - self.counted_at > SILENT else 0x80
        self._number += (seq - self.last_seq + behind & 0xFF) - behind
        self.last_seq, self.counted_at = seq, now

    def is_overtaken(self, heartbeat: m.Heartbeat, *, now: float) -> bool:
        """Return whether a newer heartbeat came just before this one. Call ``count`` first."""
        number, at = self._last_beat
        if 0 < number - self._number <= REORDERED and now - at <= REORDERED_WITHIN:
            self._overtaken = heartbeat, now
            return True
        self._last_beat = self._number, now
        return False

    def shows_another(self, message: m.Message | None, *, now: float) -> bool:
        """Return whether its autopilot sends what another vehicle would; note its unique id."""
        if isinstance(message, m.AutopilotVersion):
            return self.tasks.is_another(uid_of(message), now=now)
        if not isinstance(message, m.Heartbeat) or kind_of(message) == kind_of(
            self._monitor.latest
        ):
            return False
        self.tasks.uid = ""
        return True

    def shut(self) -> bool:
        """Send it nothing any more. Return whether it was driven, by the server or a client.

        Another part may still have this object.
        """
        self.requests.shut()
        self.pilot.close()
        return self.is_driven

    @property
    def is_driven(self) -> bool:
        """Whether the server, or a client through it, may be driving it."""
        return self.control.is_engaged or self.parts.authority.has_any_grant

    def comes_anew(self) -> None:
        """Note a new connection: sequence numbers may restart, and it may be another vehicle."""
        self._last_beat = (0, -inf)
        self.requests.ask_which_again()

    def move_to(self, outlet: PacketSender, *, may_arm: bool, is_same: bool) -> None:
        """Send to another endpoint from now on.

        ``may_arm``: whether we may arm it there. ``is_same``: its unique id was heard there.
        """
        if is_same:
            self._last_beat = (0, -inf)
        else:
            self.comes_anew()
        self.requests.move_to(outlet)
        self.requests.intervals.ask_all_again()
        self.parts.authority.moved(may_arm=may_arm)

    def come_back(self, *, was_driven: bool, halt: LastHalt | None, now: float) -> None:
        """Handle the first heartbeat of a vehicle of an earlier run: see ``Takeovers``."""
        self._takeovers.come_back(was_driven=was_driven, halt=halt, now=now)
        self._ask_for_rates(now=now)
        self.pilot.plan_tick(now=now)

    def receive(self, message: m.Message, component_id: int, *, now: float) -> None:
        """Process a message that the server itself uses."""
        if isinstance(message, m.CommandAck):
            self.requests.receive(message, component=component_id, now=now)
            self._ask_for_rates(now=now)
        elif component_id != AUTOPILOT:
            if isinstance(message, m.Heartbeat):
                self._note_component(component_id, now=now)
        elif isinstance(message, m.Heartbeat):
            self._receive_heartbeat(message, now=now)
        elif isinstance(message, Stamped):
            due = self._clock.next_at  # after a late tick, data looks old, so that a zero follows
            heard = self.where.receive(message, now=now, not_after=due)
            if heard is Heard.RESTART:
                self._restarted(booted_at=now - message.time_boot_ms / 1000, now=now)
                self.where.receive(message, now=now, not_after=due)
            elif heard is Heard.NEWS:
                self.joint.decide(now=now)
            self._look_at_frame(now=now)
            self._takeovers.look_at_motion(now=now)
            if not (self._clock.is_running or self.tasks.is_idle):
                self.joint.step(now)  # one may be ready
        elif isinstance(message, m.GpsGlobalOrigin | m.HomePosition):
            if isinstance(message, m.HomePosition):
                self.requests.heard_home()
            self.where.receive_place(message)
            self._look_at_frame(now=now)
        elif isinstance(message, m.MissionRequest | m.MissionRequestInt | m.MissionAck):
            self.requests.receive_of_plan(message, now=now)
        elif isinstance(message, m.MissionCurrent):
            self._says.receive_own_mission(message.total, now=now)
        elif isinstance(message, m.Statustext):
            sender = Address(self.system_id, component_id)
            news = self.parts.failsafes.receive_text(sender, message, now=now)
            self._takeovers.learn(news, now=now)
        elif isinstance(message, m.SysStatus):
            self.battery = charge_of(message)
            news = self.parts.failsafes.receive_status(message, now=now)
            self._takeovers.learn(news, now=now)
        elif isinstance(message, m.ParamValue):
            self._says.receive_parameter(message, now=now)
            self.joint.wake(now=now)
        elif isinstance(message, m.RcChannels):
            sent_at = self.where.clock.sent_at(message.time_boot_ms, now=now)
            if self.parts.sticks.look(message, armed=self.armed, sent_at=sent_at):
                self.joint.on(Event.STICK, Word(TaskReason.TAKEOVER, self.parts.actor), now=now)
        elif isinstance(message, m.AutopilotVersion):
            self._says.receive_identity(identity_of(message), now=now)

    def _restarted(self, *, booted_at: float, now: float) -> None:
        """Handle a reset of its clock; a heartbeat since then was not overtaken but is current."""
        self._last_beat = (0, -inf)
        self._takeovers.rebooted(booted_at=booted_at, now=now)
        heartbeat, at = self._overtaken
        if heartbeat is not None and at >= booted_at:
            self._receive_heartbeat(heartbeat, now=now)

    def _look_at_frame(self, *, now: float) -> None:
        if self.where.has_moved_frame:
            self.where.has_moved_frame = False
            self.parts.note("changed the origin of its local frame", now=now)
            self.tasks.hold(TaskReason.FRAME_RESET, now=now)

    def _receive_heartbeat(self, heartbeat: m.Heartbeat, *, now: float) -> None:
        parts, monitor = self.parts, self._monitor
        was_armed, was_mode = monitor.armed, monitor.custom_mode
        before = Before(now, parts.authority.may_arm, self.tasks.paused)
        monitor.receive(heartbeat, now=now)
        self.control.heard(armed=monitor.armed, mode=monitor.custom_mode, now=now)
        if monitor.armed and not was_armed:  # which sets home on PX4, and ends what moved it before
            self.requests.ask_for_home(now=now)
        if not self._was_heard:
            self._heard_again(now=now)
        self._takeovers.look(was_mode=was_mode, was_armed=was_armed, before=before, now=now)
        self.joint.wake(now=now)
        self._ask_for_rates(now=now)
        self.requests.ask_for_parameters()
        self._says.look(now=now)

    def _heard_again(self, *, now: float) -> None:
        self._was_heard = True
        self.requests.ask_which_again()
        self.parts.tell("heard again", now=now)
        self.joint.on(Event.HEARD_AGAIN, Word(), now=now)

    def _note_component(self, component_id: int, *, now: float) -> None:
        before = self.server_component
        if component_id not in self.components and self.components.note(component_id):
            self.server_address = self.components.server
            words = (
                f"has its own component {before}; send tasks to component {self.server_component}"
            )
            self.parts.note(words, now=now)

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
        # an autopilot answers, and executes, commands to a component that does not exist
        target = asked if asked in self.components else AUTOPILOT
        disarms = command == MavCmd.COMPONENT_ARM_DISARM and getattr(message, "param1", 1.0) == 0.0
        if disarms:
            by_force = getattr(message, "param2", 0.0) == FORCED
            self.joint.disarm(by_force=by_force, actor=actor, now=now)
        elif command == MavCmd.COMPONENT_ARM_DISARM:
            self.joint.arm(now=now)
        elif command != MavCmd.DO_SET_MODE and row_of_command(command).passed_on.kind in MOVING:
            self.parts.authority.passed_on[ANY_MODE] = now
        self.requests.relay(
            packet,
            message,
            origin,
            component=target,
            command=command,
            standing=standing,
            immediate=disarms,
            now=now,
        )

    def act(self, key: ActKey, act: Act, *, now: float) -> None:
        """Send the command of an act that is due, unless its task is interrupted before."""

        def is_outdated() -> bool:
            active = self.tasks.active
            is_driven = active is not None and (active.id, active.state) == (key[0], S.EXECUTING)
            return self.tasks.is_stopped or not is_driven

        params: list[Any] = [*act.params]
        command: m.CommandLong | m.CommandInt = m.CommandLong(
            self.system_id, act.component, act.command, 0, *params
        )
        if act.frame != MavFrame.MISSION:
            params[4:6] = map(int, params[4:6])
            command = m.CommandInt(
                self.system_id, act.component, act.frame, act.command, 0, 0, *params
            )
        self.requests.act(
            key,
            command,
            # an autopilot answers, and executes, commands to a component that does not exist
            component=act.component if act.component in self.components else AUTOPILOT,
            give_up_after=act.time_limit,
            is_outdated=is_outdated,
            now=now,
        )

    def perform(self, command: m.CommandLong | m.CommandInt, *, now: float) -> None:
        """Send a vehicle command that a plan item orders."""
        active = self.tasks.active
        if self.tasks.is_stopped or (active is not None and active.state not in RUNNING):
            return  # cancelled in the very step that ordered it
        self.requests.perform(command, now=now)

    def next_deadline(self) -> float:
        """Return when ``handle_deadline`` must be called next, s."""
        deadline = min(self._clock.next_at, self.requests.next_deadline())
        if not self._was_heard:  # a silent vehicle cannot answer: ask it nothing
            return deadline
        silent_at = self._monitor.heard_at + self.parts.settings.watch.heartbeat_lost + 1e-3
        return min(deadline, self.requests.intervals.check_at, silent_at)

    def handle_deadline(self, *, now: float) -> None:
        """Do what is due: the setpoint tick, repeats, rates, silence."""
        fell_silent = self._was_heard and not self.is_heard(now=now)
        if fell_silent:
            self._was_heard = False
            self.parts.note("silent", now=now)
        if now >= self._clock.next_at or fell_silent:
            self.joint.step(now)  # first, because it may make a request pointless
        self.requests.handle_deadline(now=now)
        self._ask_for_rates(now=now)

    def view(self, now: float) -> VehicleView:
        """Return a snapshot of the vehicle for the task domain."""
        return self.parts.view(drives_on=self._says.may_drive_on, now=now)

    def apply(self, settings: Settings) -> None:
        """Apply new settings, except those that need a restart (see the table of keys)."""
        self.parts.settings = settings
        self._monitor.lost_after = settings.watch.heartbeat_lost
        self.where.watch = settings.watch
        self.requests.apply(settings.watch)
        self._says.apply(settings)

    def _ask_for_rates(self, *, now: float) -> None:
        if self._was_heard:  # a silent vehicle cannot answer: ask it nothing
            self.requests.ask_which(now=now)
            if self.tasks.uid and self.requests.has_not_said_which(now=now):
                if not self.tasks.is_empty:  # they are paused, which is a halt
                    self.joint.on(Event.DRIVING_ENDS, Word(), now=now)
                self.tasks.unidentified(now=now)
            self.requests.ask_for_rates(now=now)
