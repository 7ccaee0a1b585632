"""Plays timed faults on rovers when they are due."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from functools import reduce
from operator import or_

from rover_sim.actuators import Actuator
from rover_sim.body import Pose
from rover_sim.fault_plan import Disarm, Lasting, PlannedFault, Push, Reboot
from rover_sim.faults import Faults
from rover_sim.manual_control import BodyByHand, turned
from rover_sim.vehicle import Vehicle

NOTHING: frozenset[Actuator] = frozenset()


@dataclass(frozen=True, slots=True)
class HandledRover:
    """A rover with the body on which faults act."""

    vehicle: Vehicle
    body: BodyByHand


class FaultPlayer:
    """Plays a plan once; the same plan at the same times has the same effects."""

    def __init__(self, plan: Iterable[PlannedFault], rovers: Sequence[HandledRover]) -> None:
        self._begin = sorted(plan, key=lambda fault: fault.at)
        self._end: list[tuple[float, PlannedFault]] = []
        self._rovers = rovers

    def __repr__(self) -> str:
        return f"FaultPlayer({len(self._begin)} to come, {len(self._end)} to end)"

    def play(self, elapsed: float, *, now: float) -> list[str]:
        """Start and end faults due ``elapsed`` seconds after the start; return log lines."""
        said = []
        while self._begin and self._begin[0].at <= elapsed:
            fault = self._begin.pop(0)
            self._start(fault, now)
            said.append(f"{elapsed:.1f} s: {fault.text}")
        over = [each for each in self._end if each[0] <= elapsed]
        if over:
            self._end = [each for each in self._end if each[0] > elapsed]
            self._break()
            said += [f"{elapsed:.1f} s: over: {fault.text}" for _, fault in over]
        return said

    def _start(self, fault: PlannedFault, now: float) -> None:
        match fault.event:
            case Lasting():
                lasts = float("inf") if fault.lasts is None else fault.lasts
                self._end.append((fault.at + lasts, fault))
                self._break()
            case Push(forward, right, turn):
                for rover in self._of(fault):
                    state = rover.body.state
                    north, east = turned(forward, right, state.yaw)
                    rover.body.place(Pose(state.north + north, state.east + east, state.yaw + turn))
            case Reboot():
                for rover in self._of(fault):
                    rover.vehicle.autopilot.reboot(now=now)
            case Disarm():
                for rover in self._of(fault):
                    rover.vehicle.autopilot.operator_arm(False, now=now)

    def _break(self) -> None:
        """Apply the present lasting faults to each rover, and clear the others."""
        for rover in self._rovers:
            lasting = [
                fault.event
                for _, fault in self._end
                if isinstance(fault.event, Lasting) and rover in self._of(fault)
            ]
            rover.body.blocked = reduce(or_, (each.blocked for each in lasting), NOTHING)
            rover.vehicle.autopilot.set_faults(joined(each.faults for each in lasting))

    def _of(self, fault: PlannedFault) -> list[HandledRover]:
        return [
            rover
            for rover in self._rovers
            if fault.rover in (None, rover.vehicle.autopilot.address.system_id)
        ]


def joined(faults: Iterable[Faults]) -> Faults:
    """Return the union of flags and sets, the only faults in plans; else the first value."""
    values = list(faults)
    if not values:
        return Faults()
    changes = {}
    for field in fields(Faults):
        each = [getattr(value, field.name) for value in values]
        changes[field.name] = (
            reduce(or_, each) if isinstance(each[0], bool | frozenset) else each[0]
        )
    return Faults(**changes)
