"""The state that a store returns when the server starts, as the events had left it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from mav_tasks.tasks.events import SignatureTime
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import Task

#: stored plans by system id and kind: (id, source) as in PlanStored
StoredPlans = Mapping[tuple[int, int], tuple[int, str]]


@dataclass(frozen=True, slots=True)
class Restored:
    """The state of an earlier run. All times are monotonic seconds of the present one.

    ``tasks`` are in the order of their submission, ``next_id`` is the id of the next. By system id:
    ``paused`` are the paused queues with the reason, ``uids`` the vehicles' unique ids, ``speeds``
    their default speeds in m/s, ``halt_epochs`` their numbers of halts, ``halted`` the reason and
    time of the last halt, ``disarmed`` the vehicles that a person disarmed. ``stopped``: by what a
    vehicle was stopped, STOP (STOPPED) or an emergency stop (STOP), that ended more of its
    ``tasks`` than these show. ``plans`` by system id and kind are (id, source) as in PlanStored,
    ``parameters`` the last value of each by name, ``signatures`` and ``signed_until`` those of
    SignaturesSeen. ``ended_well``: the last run closed its store; ``idle`` is the seconds since it
    last wrote. ``wall_offset`` is UTC minus monotonic time. ``gateway``: the name of this server
    among those that share the store; it gets vehicles, their tasks and the ids of new tasks later,
    as inputs; "" if it shares nothing. ``signing_lead``: the seconds by which it signs ahead of its
    clock to these vehicles, more than the gateway before.
    """

    tasks: tuple[Task, ...] = ()
    next_id: int = 1
    paused: Mapping[int, TaskReason] = field(default_factory=dict)
    uids: Mapping[int, str] = field(default_factory=dict)
    speeds: Mapping[int, float] = field(default_factory=dict)
    halt_epochs: Mapping[int, int] = field(default_factory=dict)
    halted: Mapping[int, tuple[TaskReason, float]] = field(default_factory=dict)
    disarmed: frozenset[int] = frozenset()
    stopped: Mapping[int, TaskReason] = field(default_factory=dict)
    plans: StoredPlans = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    signatures: tuple[SignatureTime, ...] = ()
    signed_until: int = 0
    ended_well: bool = True
    idle: float = 0.0
    wall_offset: float = 0.0
    gateway: str = ""
    signing_lead: float = 0.0
