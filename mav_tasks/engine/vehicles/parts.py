"""What the parts of one vehicle share: its state, its tasks, and the way to send to it."""

from collections.abc import Callable, Hashable
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from math import inf
from typing import NamedTuple

from mav_tasks.basics.errors import Rejection
from mav_tasks.config.settings import Settings
from mav_tasks.engine.clients.rights import Rights
from mav_tasks.engine.packets import LeaseWatch
from mav_tasks.engine.services.offboard import OffboardControl, Refused
from mav_tasks.engine.services.persona import Persona
from mav_tasks.engine.services.vehicle_status import HeartbeatMonitor
from mav_tasks.engine.vehicles.authority import Armings, Authority
from mav_tasks.engine.vehicles.own_failsafes import OwnFailsafes
from mav_tasks.engine.vehicles.shown import ShownHeartbeat, StickWatch
from mav_tasks.engine.vehicles.vehicle_position import VehiclePosition
from mav_tasks.engine.vehicles.vehicle_requests import VehicleRequests
from mav_tasks.tasks.events import VehicleNoted, VehicleSeen
from mav_tasks.tasks.halts import Permit
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import Submitter
from mav_tasks.tasks.vehicle_tasks import VehicleTasks
from mav_tasks.tasks.view import VehicleView

REFUSALS = {
    None: TaskReason.NONE,
    Refused.MODE: TaskReason.MODE_REFUSED,
    Refused.ARM: TaskReason.ARM_REFUSED,
}


GO_TO_WITHIN = 1.0  # s after a HOLD, in which the "go to" must come that undoes it


class HoldBefore(NamedTuple):
    """A HOLD that nobody may have meant: some clients silently send one before each "go to".

    MAVSDK does so to a PX4 whenever the mode is another one. The vehicle still stops at once. But
    its mode is left alone for a while, and a "go to" in that time undoes the pause.
    """

    sender: Hashable
    has_paused: bool  # it paused what was running
    since: float  # s, when the first of a client's repeated HOLDs came


class Starter(NamedTuple):
    """The client whose mission starts when the vehicle is armed: PX4's way, in two steps.

    A ground station asks for the mission mode, waits until a heartbeat shows it, and arms. If it
    arms first, the mode alone starts the mission, and there is nothing to remember.
    """

    submitter: Submitter
    rights: Rights
    plan_id: int  # as clients knew it at that time


@dataclass(slots=True)
class Parts:
    """The shared state of one vehicle."""

    system_id: int
    persona: Persona
    registry: TaskRegistry
    tasks: VehicleTasks
    requests: VehicleRequests
    where: VehiclePosition
    monitor: HeartbeatMonitor
    authority: Authority
    settings: Settings
    #: of this gateway on its vehicles
    lease: LeaseWatch
    #: the last HOLD that a "go to" may undo
    hold_before: Permit[HoldBefore]
    #: the one that a "go to" undoes once that is durable
    undone: Permit[HoldBefore]
    #: who wants its mission to start when it is armed
    start: Permit[Starter]
    #: its heartbeats as clients see them
    shown: ShownHeartbeat
    armings: Armings = field(default_factory=Armings)
    failsafes: OwnFailsafes = field(default_factory=OwnFailsafes)
    sticks: StickWatch = field(default_factory=StickWatch)
    #: s, until when it is only listened to: another controller may show itself
    listens_until: float = -inf
    #: handle changes that a person, or a restart, has caused; no task starts before that
    undecided: list[Callable[[float], None]] = field(default_factory=list)
    control: OffboardControl = field(init=False)

    def __post_init__(self) -> None:
        self.control = self.requests.control

    @property
    def actor(self) -> str:
        """The actor in the journal for what the vehicle itself, or somebody at it, did."""
        return f"vehicle {self.system_id}"

    @property
    def is_manual(self) -> bool:
        return self.monitor.custom_mode in self.persona.manual_modes

    def is_driven_by_others(self, *, now: float) -> bool:
        """Return whether a client, or somebody else, was driving it just now."""
        return self.authority.since_other(now=now) < self.settings.watch.other_controller

    def is_armed(self, *, now: float) -> bool:
        """Return whether it shows armed, by a request that no halt has outdated."""
        ours = self.control.arming_asked_at
        return self.monitor.armed and not self.armings.do_not_count(ours=ours, now=now)

    def note(self, text: str, *, now: float) -> None:
        """Report a text about the vehicle."""
        self.registry.record(VehicleNoted(self.system_id, text, now))

    def tell(self, text: str, *, now: float) -> None:
        """Report a text about the vehicle on which nobody has to act."""
        self.registry.record(VehicleSeen(self.system_id, text, now))

    def withdraw_arming(self, *, now: float) -> None:
        """Withdraw the permission to arm, also across a restart of the server."""
        self.authority.withdraw_arming()
        self.tasks.let_arm(may_be_armed=False, now=now)

    def forget_answers(self) -> None:
        """Forget everything that the vehicle said of itself before its restart."""
        self.requests.ask_which_again()
        self.forget_firmware()
        self.failsafes = OwnFailsafes()
        self.where.forget()
        self.sticks.forget()

    def forget_firmware(self) -> None:
        """Forget what belongs to the vehicle's firmware: it is asked again."""
        self.requests.intervals.ask_all_again()
        self.requests.parameters.forget()

    def forget_go_to(self) -> None:
        """Note another request: a "go to" undoes no earlier HOLD any more."""
        self.hold_before.end()
        self.undone.end()

    def held_by(self, sender: Hashable, *, has_paused: bool, now: float) -> None:
        """Note a client's HOLD, which is a halt.

        Repetitions by the same client count as one HOLD, if nothing else came between.
        """
        held = HoldBefore(sender, has_paused, now)
        before = self.hold_before.holder(now=now, halts=1)
        if before is not None and before.sender == sender:
            held = HoldBefore(sender, has_paused or before.has_paused, before.since)
        self.undone.end()
        self.hold_before.give(held, until=now + GO_TO_WITHIN)

    def forget_start(self) -> None:
        """Forget that a mission starts with the arming: it changed, or is unwanted."""
        self.start.end()
        self.shown.mode.end()

    def forget_start_of(self, keys: AbstractSet[str], *, now: float) -> None:
        """Forget that a mission starts with the arming if one of these keys asked for it."""
        starter = self.start.holder(now=now)
        if starter is not None and starter.submitter.key in keys:
            self.forget_start()

    def check_not_manual(self, *, now: float) -> None:
        """Raise Rejection while a person drives: manual mode, armed, and moving or stick input."""
        if not (self.monitor.armed and self.is_manual):
            return
        if self.is_driven_by_others(now=now):
            raise Rejection(TaskReason.OTHER_CONTROLLER, "the rover is under manual control")
        if not self.where.is_still(now=now):
            raise Rejection(TaskReason.WRONG_MODE, "under manual control and moving: stop it first")

    def view(self, *, drives_on: bool, now: float) -> VehicleView:
        """Return a snapshot of the vehicle for the task domain.

        ``drives_on``: it might not stop when setpoints end, although the settings demand that.
        """
        watch, monitor, persona, where = self.settings.watch, self.monitor, self.persona, self.where
        control, mode = self.control, monitor.custom_mode
        return VehicleView(
            heard=monitor.is_heard(now=now),
            mode=self.authority.kind_of(mode, armed=monitor.armed),
            is_untouched=control.is_untouched,
            is_booting=mode == persona.booting_mode,
            armed=self.is_armed(now=now),
            may_arm=self.authority.may_arm,
            in_control=control.in_control,
            refusal=REFUSALS[control.refused],
            is_not_ready=control.is_not_ready,
            why_not_ready=self.failsafes.why_not_ready(now=now),
            motion=where.latest(),
            still=where.is_still(now=now),
            other_controller=self.authority.since_other(now=now) < watch.other_controller,
            frame=where.frame(),
            home=where.home,
            is_home_old=self.requests.is_home_old and where.said_home is not None,
            is_fence_unknown=where.is_fence_unknown,
            is_outside_own_fence=self.failsafes.is_outside_fence,
            honours_yaw_rate=persona.honours_yaw_rate,
            turning=persona.turning,
            turns_by_course=persona.turns_by_course,
            turning_radius=persona.turning_radius or self.settings.driving.turning_radius,
            # who it is, or who else controls it; it may also have just restarted
            is_unknown=bool(self.tasks.uid and not self.requests.is_identified)
            or bool(self.undecided)
            or now < self.listens_until,
            drives_on=drives_on,
            is_engaged=control.is_engaged,
            is_ours=self.lease.is_trusted,
        )
