"""Plays timed faults on rovers when they are due."""

from collections.abc import Iterable, Sequence
from dataclasses import fields
from typing import Any

from rover_sim.fault_plan import PlannedFault
from rover_sim.faults import NO_FAULTS, Faults
from rover_sim.vehicle import Vehicle

FLAGS_AND_SETS = [
    field.name
    for field in fields(Faults)
    if isinstance(getattr(NO_FAULTS, field.name), bool | frozenset)
]


class FaultPlayer:
    """Plays a plan once; the same plan at the same times has the same effects."""

    def __init__(self, plan: Iterable[PlannedFault], rovers: Sequence[Vehicle]) -> None:
        self._begin = sorted(plan, key=lambda fault: fault.at)
        self._lasting: list[PlannedFault] = []
        self._rovers = rovers

    def play(self, elapsed: float, *, now: float) -> list[str]:
        """Start and end faults due ``elapsed`` seconds after the start; return log lines."""
        said = []
        while self._begin and self._begin[0].at <= elapsed:
            fault = self._begin.pop(0)
            said.append(f"{elapsed:.1f} s: {fault.text}")
            if isinstance(fault.event, Faults):
                self._lasting.append(fault)
                self._break()
            else:
                for rover in self._of(fault):
                    fault.event(rover, now)
        over = [fault for fault in self._lasting if fault.at + fault.lasts <= elapsed]
        if over:
            self._lasting = [fault for fault in self._lasting if fault not in over]
            self._break()
            said += [f"{elapsed:.1f} s: over: {fault.text}" for fault in over]
        return said

    def _break(self) -> None:
        """Apply the present lasting faults to each rover, and clear the others."""
        for rover in self._rovers:
            lasting = [
                fault.event
                for fault in self._lasting
                if isinstance(fault.event, Faults) and rover in self._of(fault)
            ]
            rover.autopilot.set_faults(joined(lasting))

    def _of(self, fault: PlannedFault) -> list[Vehicle]:
        return [
            rover
            for rover in self._rovers
            if fault.rover in (None, rover.autopilot.address.system_id)
        ]


def joined(faults: Sequence[Faults]) -> Faults:
    """Return the union of flags and sets, the only faults in plans."""
    changes: dict[str, Any] = {}
    for each in faults:
        for name in FLAGS_AND_SETS:
            value = getattr(each, name)
            changes[name] = changes.get(name, value) | value
    return Faults(**changes)
