"""Carries out what the tasks of a vehicle demand, tick by tick: driving it or stopping it.

It checks that the vehicle obeys. A finding about a task is an event for the control table.
"""

from collections.abc import Callable
from math import inf

from mav_tasks.engine.services.offboard import REGAINED_UNSEEN
from mav_tasks.engine.services.orders import Phase, Posture, Speeds
from mav_tasks.engine.vehicles.motion_guard import MotionGuard, Seen
from mav_tasks.engine.vehicles.parts import Parts
from mav_tasks.tasks.goal import ends_at_home
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.task import Task
from mav_tasks.tasks.view import STOP, Demand, DemandKind, VehicleView

GOLDEN = 0.6180339887  # its multiples, modulo 1, are never close together


class SetpointClock:
    """The setpoint ticks of one vehicle. Times are monotonic seconds."""

    def __init__(self, system_id: int, *, period: float) -> None:
        self._phase = system_id * GOLDEN % 1.0 * period  # evenly spread for any number of vehicles
        self._period = period
        #: when the next tick is due; inf while nothing is sent
        self.next_at = inf

    def __repr__(self) -> str:
        return f"SetpointClock(next at {self.next_at:.3f})"

    @property
    def is_running(self) -> bool:
        """Whether a tick is planned."""
        return self.next_at < inf

    def restart(self, *, now: float) -> None:
        """Note that a setpoint was just sent out of turn; the next follows within a period."""
        self.next_at = now + self._period - (now - self._phase) % self._period

    def plan(self, *, now: float) -> None:
        """Plan the next tick, unless one is planned; missed ticks are not made up for."""
        if now < self.next_at < inf:
            return
        following = self.next_at + self._period
        if now < following < inf:
            self.next_at = following
        else:
            self.restart(now=now)

    def stop(self) -> None:
        """Cancel the next tick."""
        self.next_at = inf


#: s after a stuck task, in which the vehicle may still be stopping although it reports standstill
UNSEEN_STOP = 3.0
SHOWS_AGAIN = 1.5  # s after a gap, within which the next 1 Hz heartbeat comes
BRAKES_FOR = 8.0  # s of set-points before the HOLD of a STOP, at most; the longest stop took 4 s


class Pilot:
    """Drives one vehicle as its tasks demand."""

    def __init__(self, parts: Parts, view: Callable[[float], VehicleView]) -> None:
        """``view`` returns a snapshot of the vehicle at a time."""
        self._parts = parts
        self._view = view
        #: when the next set-point is due
        self.clock = SetpointClock(parts.system_id, period=parts.settings.watch.setpoint_period)
        #: checks that it moves as it was told to
        self.guard = MotionGuard(parts)
        self._is_closing = False
        self._regained_at = -inf  # s, when it was met driving
        self._is_back_home = False  # its last task returned home: disarm it even if others wait

    def __repr__(self) -> str:
        return f"Pilot({self.clock!r}, {self.guard!r})"

    def close(self) -> None:
        """Only stop the vehicle from here on: the server ends."""
        self._is_closing = True

    def follow(self, *, now: float) -> list[Seen]:
        """Run the tasks and carry out their demand. Return the findings; call ``send`` next."""
        parts = self._parts
        tasks, executor = parts.tasks, parts.tasks.executor
        self._face(now=now)
        seen = self._view(now)
        begun_before = executor.task_id
        demand = STOP if self._is_closing else tasks.step(seen, now=now)
        self._is_back_home = self._is_back_home and executor.task_id is None
        if begun_before is not None and executor.task_id is None:
            ended = parts.registry[begun_before]
            parts.authority.revoke()
            self._note_end(ended)
            if ended.reason is TaskReason.STUCK:
                parts.where.doubt(until=now + UNSEEN_STOP)
                seen = self._view(now)
        self._obey(demand, seen, now=now)
        return self.guard.look(demand, seen, is_deaf=self._is_deaf(now=now), now=now)

    def send(self, *, now: float) -> None:
        """Send what is queued in this tick, and plan the next tick."""
        if self._parts.requests.flush(now=now):
            self._parts.tasks.executor.setpoint_left(now=now)
        self.plan_tick(now=now)

    def plan_tick(self, *, now: float) -> None:
        """Plan the next tick if there is anything to drive or to watch."""
        parts = self._parts
        is_begun = parts.tasks.executor.task_id is not None
        if is_begun or parts.control.is_engaged or self.guard.is_on:
            self.clock.plan(now=now)
        else:
            self.clock.stop()

    def begin_stop(self, *, brakes: bool, now: float) -> None:
        """Begin the stop ladder; zero and HOLD leave in this very step.

        ``brakes``: start with set-points if they stop this vehicle sooner than HOLD does.
        """
        parts = self._parts
        self._face(now=now)
        # met driving just now, it has not said yet how it turns
        is_known = parts.requests.parameters.turning is not None
        may_be_car = now - self._regained_at <= BRAKES_FOR and not is_known
        is_better = parts.persona.brakes_by_setpoints or may_be_car
        is_seen = parts.where.is_fresh(now=now) or now - self._regained_at <= REGAINED_UNSEEN
        brakes = brakes and is_better and is_seen
        longest = parts.settings.watch.shutdown - 1.0 if self._is_closing else BRAKES_FOR
        parts.control.begin_stop(now=now, brake_for=longest if brakes else 0.0)
        self.guard.begin(now=now)
        parts.requests.end_performing()
        self._send_at_once(now=now)

    def let_go(self, *, now: float) -> None:
        """Send zero and HOLD at once, and repeat HOLD until it shows."""
        self._parts.control.begin_release(now=now)
        self._send_at_once(now=now)

    def stand_in(self, *, now: float) -> None:
        """Ask a rover to stand, in place of a setpoint of the client that may drive it.

        A PX4 is armed in our mode only while setpoints stream. The client's own would move it as
        soon as it is armed, before a heartbeat shows that; from then on they pass.
        """
        if self._parts.persona.arms_in_hold:
            self._face(now=now)
            self._parts.requests.send_stand_in()

    def watch(self, *, now: float) -> None:
        """Watch from here on that it comes to stand."""
        self.guard.begin(now=now)
        self._send_at_once(now=now)

    def regain(self, *, now: float) -> None:
        """Brake a vehicle by set-points from here on: it still drives on those of an earlier run.

        Whether it steers as a car is not known yet: it is asked.
        """
        self._regained_at = now
        self._parts.control.regain(now=now)
        self._parts.requests.ask_for_parameters()
        self.guard.told_to_move(now=now)
        self.watch(now=now)

    def brakes_against_stick(self, *, now: float) -> bool:
        """Return whether set-points stop it before HOLD is asked for, although a stick is held.

        HOLD stops every vehicle, but some roll on in it.
        """
        parts = self._parts
        is_known = bool(parts.sticks.throttle(now=now)) and parts.where.is_fresh(now=now)
        return parts.persona.brakes_by_setpoints and is_known

    def _send_at_once(self, *, now: float) -> None:
        self.clock.restart(now=now)
        self._parts.requests.flush(now=now)

    def is_late(self, *, now: float) -> bool:
        """Return whether a tick came so late that the vehicle drove on without us."""
        active = self._parts.tasks.active
        late = now - self.clock.next_at > self._parts.settings.watch.late_tick
        return late and active is not None and active.state is TaskState.EXECUTING

    def _face(self, *, now: float) -> None:
        """Tell the offboard control what decides how the vehicle is asked to stand."""
        parts = self._parts
        motion = parts.where.latest()
        is_known = motion is not None and now - motion.at <= parts.settings.watch.position_lost
        yaw = motion.pose.yaw if motion is not None and is_known else None
        persona = parts.persona
        by_speed_loop = persona.rolls_out or persona.stands_by_course
        rolls = by_speed_loop and self.guard.brakes(rolls_out=persona.rolls_out, now=now)
        parts.control.posture = Posture(yaw, rolls=rolls, stick=parts.sticks.throttle(now=now))

    def _obey(self, demand: Demand, seen: VehicleView, *, now: float) -> None:
        parts = self._parts
        control = parts.control
        match demand.kind:
            case DemandKind.TAKE:
                control.take(may_arm=seen.may_arm, now=now)
                if control.wants_heartbeat:
                    control.wants_heartbeat = False
                    parts.requests.ask_to_show(now=now)
            case DemandKind.DRIVE:
                wanted = demand.velocity
                if not wanted.is_zero:
                    parts.where.may_move()
                control.drive(Speeds(wanted.forward, wanted.yaw_rate, wanted.course))
            case DemandKind.HOLD:
                is_deaf, disarm = self._is_deaf(now=now), self._is_back_home
                still = seen.still and not is_deaf and parts.hold_before.holder(now=now) is None
                slows = is_deaf or self.guard.is_slowing(now=now)
                control.release(
                    still=still, disarm=disarm, now=now, is_slowing=slows, is_deaf=is_deaf
                )
            case DemandKind.HAND_BACK:
                slows = self.guard.is_slowing(now=now)
                control.release(still=seen.still, disarm=True, now=now, is_slowing=slows)
            case DemandKind.HALT if control.phase is not Phase.STOPPING:
                self.begin_stop(brakes=True, now=now)
            case DemandKind.STOP | DemandKind.HALT:
                control.stop(still=seen.still, heard=seen.heard, now=now)

    def _is_deaf(self, *, now: float) -> bool:
        """Return whether a task stands after a loss, and no heartbeat has come yet.

        A person may have taken the vehicle over meanwhile: HOLD would undo that, zeros would not.
        """
        parts = self._parts
        heard_at, lost_at = parts.monitor.heard_at, parts.tasks.executor.lost_since
        is_soon = now - heard_at <= parts.settings.watch.heartbeat_lost + SHOWS_AGAIN
        return lost_at is not None and heard_at < lost_at and is_soon

    def _note_end(self, ended: Task) -> None:
        """After a completed return, disarm it, whoever armed it, as a landed autopilot does."""
        self._is_back_home = ended.state is TaskState.COMPLETED and ends_at_home(ended.goal)
        if self._is_back_home:
            self._parts.control.disarm_at_end()
