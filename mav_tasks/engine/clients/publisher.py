"""Sends clients what they do not request each time: heartbeats, TASK_STATUS and texts.

A TASK_STATUS with a final state is sent once that state is durable, so that it is never taken back,
or after the time limit of the commit gate. A state that a client requests is sent at once.

Each second it also asks the vehicles for the message intervals that clients want and a link
carries. It computes them from the present clients only: the requests of a client end when it is
gone, or so silent that it gets no telemetry any more. And it watches whether a ground station is
heard: the heartbeats of all of them count.
"""

from functools import partial
from math import inf

from mav_tasks.config.settings import Settings
from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.gcs_side import GcsSide
from mav_tasks.engine.clients.message_requests import MessageRequests
from mav_tasks.engine.commands import translate
from mav_tasks.engine.commands.submissions import PAUSED, Submissions
from mav_tasks.engine.services.rate_budget import granted
from mav_tasks.engine.services.vehicle_status import INTERVAL, component_heartbeat
from mav_tasks.engine.timers import Timers, Turn
from mav_tasks.engine.vehicles.control import Event as ControlEvent
from mav_tasks.engine.vehicles.joint_control import BUTTONS, Word
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavSeverity, MavState, MavType
from mav_tasks.mavlink.packet import Packet
from mav_tasks.tasks.events import (
    Event,
    QueueContinued,
    TaskAdvanced,
    TaskAssigned,
    TaskChanged,
    TaskModified,
    TaskSubmitted,
    TaskWaits,
)
from mav_tasks.tasks.lifecycle import TERMINAL, TaskReason, TaskState, words_of
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import Task, TaskId
from mav_tasks.tasks.vehicle_tasks import VehicleTasks


def summary_of(tasks: VehicleTasks) -> str:
    """Return why a rover's tasks are stopped, and what to press; "" if they are not."""
    waiting = len(tasks.waiting)
    wait = f"; {_waiting(waiting)}" if waiting else ""
    held = _in_state(tasks, TaskState.HELD)
    if tasks.paused is TaskReason.STOPPED:
        return f"STOP in force, press Continue{wait}"
    if held is not None:
        return f"Task {held.id} held: {words_of(held.reason)}. Press {BUTTONS}{wait}"
    active = _in_state(tasks, TaskState.PAUSED)
    why = PAUSED.get(tasks.paused, words_of(tasks.paused))
    if tasks.paused and active is not None:
        return f"Task {active.id} paused, press Continue ({why}){wait}"
    if tasks.paused and waiting:
        return f"{_waiting(waiting)}, press Continue ({why})"
    return ""


def next_words(tasks: VehicleTasks) -> str:
    """Return which task drives next, to end a text; "" if none does."""
    task_id = None if tasks.held else tasks.executor.task_id or tasks.next_id
    task = None if task_id is None else tasks.registry[task_id]
    if task is None or task.state is TaskState.CANCELLING:
        return ""
    behind = len(tasks.waiting) - (task.id in tasks.waiting)
    wait = f"; {_waiting(behind)} behind it" if behind else ""
    return f": task {task.id} is next, {task.goal.words}{wait}"


def _waiting(count: int) -> str:
    return "1 task waits" if count == 1 else f"{count} tasks wait"


def _in_state(tasks: VehicleTasks, state: TaskState) -> Task | None:
    """Return the first active or suspended task in this state."""
    active = [] if tasks.active is None else [tasks.active]
    return next((task for task in (*active, *tasks.suspended) if task.state is state), None)


UNHEARD = Word(text="is paused: no ground station is heard")


class Publisher:
    """The sender of heartbeats, TASK_STATUS and texts to clients."""

    def __init__(
        self,
        gcs: GcsSide,
        vehicles: VehicleSide,
        registry: TaskRegistry,
        displays: MessageRequests,
        submissions: Submissions,
        timers: Timers,
        settings: Settings,
        *,
        now: float,
    ) -> None:
        self._gcs = gcs
        self._vehicles = vehicles
        self._registry = registry
        self._displays = displays
        self._submissions = submissions
        self._had_wishes = False
        self._operator_heard_at = inf  # s; inf: none was heard, or its loss was noted
        self._operator = timers.timer(Turn.OPERATOR, self._lose_operator)
        self._ended: set[int] = set()  # tasks whose end is not durable yet
        timers.rhythm(Turn.HEARTBEATS, self._beat, period=INTERVAL, now=now)
        self.apply(settings)

    def apply(self, settings: Settings) -> None:
        self._settings = settings
        self._operator.set(self._operator_heard_at + settings.watch.operator_lost)

    def hear_operator(self, heartbeat: m.Heartbeat, *, now: float) -> None:
        """Note the heartbeat of a ground station, if it is one's."""
        if heartbeat.type == MavType.GCS:
            self._operator_heard_at = now
            self.apply(self._settings)

    def _lose_operator(self, *, now: float) -> None:
        """Pause all vehicles, if configured so: no ground station is heard any more."""
        self._operator_heard_at = inf
        if self._settings.operator_lost == "pause":
            for vehicle in self._vehicles.addressed_by(0):
                vehicle.joint.on(ControlEvent.OPERATOR_LOST, UNHEARD, now=now)

    def welcome(self, client: GcsClient, *, now: float) -> None:
        """Send a client the latest heartbeat of each vehicle that it has not seen yet."""
        for vehicle in self._vehicles.all:
            if vehicle.system_id in client.introduced or not vehicle.is_heard(now=now):
                continue  # a silent vehicle must not look alive
            if vehicle.last_heartbeat is not None:
                heartbeat = vehicle.shown.applied(
                    vehicle.last_heartbeat, is_stopped=vehicle.tasks.is_stopped, now=now
                )
                # before anything else of its system; the autopilot's next packet follows on
                client.introduced.add(vehicle.system_id)
                client.outlet.forward(heartbeat._replace(seq=vehicle.last_seq))

    def withhold(self, packet: Packet) -> None:
        """Note for every client that a vehicle's packet is not forwarded: no gap shows."""
        for client in self._gcs.clients:
            client.outlet.withhold(packet.source)

    def publish(self, events: list[Event], *, now: float) -> None:
        """Send events as texts to all clients, and as TASK_STATUS to submitters and followers."""
        if TaskChanged in map(type, events):
            ended = {e.task_id for e in events if isinstance(e, TaskChanged) and e.new in TERMINAL}
            self._ended |= ended
            tell = partial(self._tell_ends, ended)
            if ended:
                self._submissions.gate.hold(tell, tell, now=now)
        for event in events:
            if isinstance(event, TaskSubmitted):
                if event.task.terms.series and event.task.is_made:
                    self.note_change(event.task.id)
                continue  # ``Submissions`` and ``MissionUploads`` tell everybody of it
            spoken = translate.text_of(event)
            if spoken is not None:
                system_id, severity, text = spoken
                if vehicle := self._vehicles.get(system_id):
                    if isinstance(event, QueueContinued):
                        text += next_words(vehicle.tasks)
                    self._gcs.tell(text, severity, vehicle.server_address, now=now)
            if isinstance(
                event, TaskChanged | TaskModified | TaskAssigned | TaskAdvanced | TaskWaits
            ):
                self.note_change(event.task_id)

    def warn_of_store(self, *, now: float) -> None:
        """Tell all clients that the store has failed."""
        text = "Store failed: new tasks are refused. See the server's log"
        for vehicle in self._vehicles.all:
            self._gcs.tell(text, MavSeverity.ERROR, vehicle.server_address, now=now)

    def _tell_ends(self, ended: set[TaskId], *, now: float) -> None:
        self._ended -= ended
        for task_id in sorted(ended):
            self.note_change(task_id)
        self.send_statuses(now=now)

    def note_change(self, task_id: TaskId) -> None:
        """Schedule a TASK_STATUS to the submitter of a task, and to clients that follow it."""
        task = self._registry.get(task_id)
        if task is None or task_id in self._ended:
            return
        for client in self._gcs.clients:
            # a nonce proves it for good; after a restart or a long silence the client is a new one
            reads = client.uses_dialect or task.marks.nonce
            if (reads and client.submitted(task)) or task.id in client.followed:
                client.note_change(task.id)

    def _beat(self, *, now: float) -> None:
        """Each second: heartbeats, message rates, dropped texts; forget silent clients."""
        self._gcs.forget_silent(awaits=self._registry.is_awaited_at, now=now)
        self._ask_for_telemetry(now=now)
        self._send_heartbeats(now=now)
        for client in self._gcs.clients:
            if client.left_out:
                client.tell_what_was_left_out(now=now)

    def send_statuses(self, *, now: float) -> None:
        """Send each client the statuses that are due."""
        due = inf
        for client in self._gcs.clients:
            if client.statuses_due <= now:
                for task_id in client.due_statuses(self._vehicles.look_at, now=now):
                    if task_id not in self._ended:
                        self._displays.push_status(client, task_id, now=now)
            due = min(due, client.statuses_due)
        self._gcs.statuses.set(due)

    def _send_heartbeats(self, *, now: float) -> None:
        """Send the task server's heartbeat for each vehicle that is heard, to each client heard.

        A pushed address gets none before it answers. Its client must hear the autopilot first,
        because an older MAVSDK otherwise never connects.

        DEVIATION: the task server's component falls silent with its vehicle; its heartbeats would
        otherwise hide from a ground station that the vehicle is lost.
        """
        for vehicle in self._vehicles.all:
            if not vehicle.is_heard(now=now):
                continue
            active = vehicle.tasks.active is not None
            heartbeat = component_heartbeat(MavState.ACTIVE if active else MavState.STANDBY)
            source, new = vehicle.server_address, list[GcsClient]()
            for client in self._gcs.clients:
                if client.is_heard and vehicle.system_id in client.introduced:
                    client.outlet.send(heartbeat, source)
                    view = client.view(vehicle.system_id)
                    if not view.is_informed:
                        view.is_informed = True
                        new.append(client)
            # who is new, or back, has missed what is held or paused. It is told with the next
            # heartbeat: a ground station ignores texts of a vehicle that it has only just heard of
            words = summary_of(vehicle.tasks) if new else ""
            for client in new if words else ():
                client.tell(words, MavSeverity.WARNING, source, now=now)

    def _ask_for_telemetry(self, *, now: float) -> None:
        clients = [each for each in self._gcs.clients if each.is_heard and each.pace.has_wishes]
        if not clients and not self._had_wishes:
            return
        self._had_wishes = bool(clients)
        for vehicle in self._vehicles.all:
            least: dict[bool, dict[int, float]] = {True: {}, False: {}}
            for client in clients:
                for number, wish in client.view(vehicle.system_id).wishes.items():
                    if wish.commands is not None and wish.interval is not None:
                        intervals = least[wish.commands]
                        intervals[number] = min(wish.interval, intervals.get(number, inf))
            spare = self._vehicles.link_budget(vehicle, now=now).spare
            vehicle.requests.intervals.set_wishes(granted(least[True], least[False], spare=spare))
