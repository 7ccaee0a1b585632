"""One client: an endpoint on a client link, what it was sent and what it requested."""

from collections.abc import Callable, Collection
from math import inf

from mav_tasks.basics.latest import keep_latest, shorten
from mav_tasks.config.settings import Clients
from mav_tasks.engine.clients.rights import NOTHING, SUBMITTER, Rights
from mav_tasks.engine.clients.sender import OBSERVED, Memory, Sender
from mav_tasks.engine.clients.signatures import UNSIGNED
from mav_tasks.engine.clients.vehicle_view import LONGEST_US, STREAMED, Pace, VehicleView
from mav_tasks.engine.inputs import FLEET_LINK
from mav_tasks.engine.packets import PacketSender
from mav_tasks.engine.services import statustext
from mav_tasks.engine.services.commands import Answer
from mav_tasks.engine.services.token_bucket import TokenBucket
from mav_tasks.engine.timers import Timer
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.enums import MavSeverity
from mav_tasks.mavlink.packet import Packet
from mav_tasks.tasks.task import Submitter, Task

AT_ONCE = 5.0  # s, whose requests may come in one burst: a script queues a day's work
CHANGES = 1 / 20  # of the rate of requests: what is stored, or lets a rover go
LEAST_CHANGES = 1.0  # /s, if the requests may be so many
REFUSALS, REFUSALS_AT_ONCE = 2.0, 20.0  # told and recorded: a second, and in one burst
#: s for which a refusal is not repeated: QGroundControl asks three times for a mode, 1.3 s apart,
#: and sends one "go to" in two messages
REFUSAL_EACH = 5.0
MAX_REFUSALS_TOLD = 64
MAX_LIMITS = 64  # roles, limited keys and rates of one client
BACK_AFTER = 3.5  # s of silence, after which a ground station may have been restarted
OLD = 0.5  # s; a packet that lay here longer may be older than packets that came since
MAX_ADDRESSES = 8  # MAVLink addresses remembered of one endpoint
ELSEWHERE = 0.5  # s between messages of one type to a client at another gateway
MAX_SENDERS = 32  # addresses at one endpoint whose commands are remembered: there may be a router
WITHIN = 1.0  # s, whose datagrams may come in one burst
STATUSES_AT_ONCE = 20  # TASK_STATUS, before the rate counts
MAX_CHANGED = 1000  # tasks whose news waits to be told to one client
SHORTEST, LONGEST = 0.05, LONGEST_US / 1e6  # s between reports of one task to one client
NO_STANDING = (0, False)  # of a client that has said nothing yet


class GcsClient:
    """One endpoint that receives telemetry, and perhaps sends commands."""

    def __init__(
        self,
        outlet: PacketSender,
        *,
        settings: Clients,
        statuses: Timer,
        now: float,
    ) -> None:
        """``statuses`` fires when a TASK_STATUS to some client is due."""
        self.outlet = outlet
        link, peer = outlet.link, outlet.peer
        #: link and endpoint, which identify the client
        self.key = (link, peer)
        #: the endpoint as text
        self.endpoint = ":".join(map(str, peer)) if isinstance(peer, tuple) else str(peer)
        self.heard_at = now
        #: configured or connected: gets heartbeats before it has sent anything
        self.is_configured = False
        #: on a stream link, which reports when it is gone: may be silent for any time
        self.is_connected = False
        self.is_heard = False
        #: heard at most once so far
        self.is_passing = True
        #: added while many clients were: gets only heartbeats until it is heard a second time
        self.is_one_of_many = False
        #: key of the packet in hand, or of the last one
        self.signed_by = UNSIGNED
        #: when the packet in hand arrived, s, and for how long it may have waited to be handled
        self.arrived, self.waited = now, 0.0
        #: source address of the packet in hand
        self.source: Address | None = None
        #: its submitter
        self.who = Submitter(link, self.endpoint, 0, 0)
        #: addresses seen here, the latest last
        self.addresses: dict[Address, None] = {}
        #: whether it has used our dialect: it gets TASK_STATUS then
        self.uses_dialect = False
        #: tasks that it has asked about, and is told each change of; the latest last
        self.followed: dict[int, None] = {}
        #: its telemetry
        self.pace = Pace(settings.stream_interval, ELSEWHERE if link == FLEET_LINK else 0.0)
        #: by system id; made when the client is sent the vehicle's telemetry, or asks for it
        self.views: dict[int, VehicleView] = {}
        #: tasks to be told of, in this order; the state is that at the time of sending
        self._changed: dict[int, None] = {}
        #: interval and next time of TASK_STATUS of an active task, s, by vehicle
        self.status_streams: dict[int, tuple[float, float]] = {}
        self._statuses_from = 0.0  # s, until when the rate lets no TASK_STATUS leave
        self._timer = statuses
        #: s, when ``due_statuses`` may have something to give; inf: never, as things are
        self.statuses_due = inf
        self._text_id = 0
        self._refusals_told: dict[tuple[Address, str], float] = {}  # when, by source and text
        #: counts of texts above the rate limit, by source
        self.left_out: dict[Address, int] = {}
        #: vehicles whose autopilot's heartbeat it was sent
        self.introduced: set[int] = set()
        #: until when it gets no MISSION_CURRENT, s: it was refused an item
        self.gives_up_at = -inf
        #: the value of a centred throttle stick that its MANUAL_CONTROL.z was last nearest to
        self.throttle_centre: int | None = None
        #: by role, limited key and rate, which may change: the limits of requests, and of changes
        self._limits_of: dict[tuple[str, str, float], tuple[TokenBucket, TokenBucket]] = {}
        self._refusals = TokenBucket(rate=REFUSALS, burst=REFUSALS_AT_ONCE)
        self._statuses = TokenBucket(rate=settings.status_rate, burst=STATUSES_AT_ONCE)
        self._texts = TokenBucket(rate=settings.text_rate, burst=statustext.BURST)
        self._memory = Memory()
        self._senders: dict[Address | None, Sender] = {}
        self._observers = Sender(Memory(OBSERVED))
        self.take_rights(NOTHING)
        self.apply(settings)

    def __repr__(self) -> str:
        names = " ".join(map(str, self.addresses)) or "unheard"
        return f"GcsClient({names} at {self.endpoint})"

    def apply(self, settings: Clients) -> None:
        self.pace.default_interval = settings.stream_interval
        self._statuses.rate, self._texts.rate = settings.status_rate, settings.text_rate
        rate = settings.packet_rate
        #: the limit of its datagrams
        self.datagrams = TokenBucket(rate=rate, burst=rate * WITHIN)

    @property
    def standing(self) -> tuple[int, bool]:
        """What it may do, and whether it signs: what makes room for it, or has to make room."""
        return self.rights.rank, self.signed_by is not UNSIGNED

    @property
    def is_late(self) -> bool:
        """Whether the packet in hand waited while the server was stalled."""
        return self.waited > OLD

    def submitter(self, source: Address) -> Submitter:
        """Return the submitter for packets of ``source`` from this endpoint."""
        key = self.signed_by
        who = key.name, key.name and key.fingerprint
        return Submitter(self.outlet.link, self.endpoint, *source, *who)

    def take_rights(self, rights: Rights) -> None:
        """Set what the submitter may do, the limits of its key or role, and its ``Sender``."""
        self.rights, rate = rights, rights.limits.rate
        self.is_observer = not rights.reach(SUBMITTER)
        #: of the packet in hand
        self.sender = self._sender()
        place = rights.role, rights.key, rate
        limits = self._limits_of.get(place)
        if limits is None:
            burst = rate * AT_ONCE
            requests = TokenBucket(rate=rate, burst=burst)
            changes = max(rate * CHANGES, min(rate, LEAST_CHANGES))
            limits = requests, TokenBucket(rate=changes, burst=burst)
            keep_latest(self._limits_of, place, limits, most=MAX_LIMITS)
        self.requests, self.changes = limits

    def may_be_refused(self, *, now: float) -> bool:
        """Whether one more refusal may be told and recorded now; a flood of them is not."""
        return self._refusals.take(now=now)

    def submitted(self, task: Task) -> bool:
        """Whether a task was submitted from this endpoint."""
        submitter = task.submitter
        return (submitter.link, submitter.endpoint) == (self.outlet.link, self.endpoint)

    def _sender(self) -> Sender:
        """Return the ``Sender`` at the present address; one for all observers.

        Nothing of theirs lets a rover go, so that neither their numbers nor their words matter.
        """
        if self.is_observer:
            return self._observers
        sender = self._senders.get(self.source)
        if sender is None:
            sender = Sender(self._memory)
            keep_latest(self._senders, self.source, sender, most=MAX_SENDERS)
        return sender

    def heard(self, packet: Packet, *, now: float) -> None:
        source = packet.source
        if not self.is_observer:
            self.sender.line.place(packet.seq, now=self.arrived)
        self.is_passing = not self.is_heard
        if now - self.heard_at > BACK_AFTER:
            for view in self.views.values():
                view.is_informed = False
        self.is_one_of_many = self.is_one_of_many and self.is_passing
        self.heard_at = now
        self.is_heard = True
        if source not in self.addresses:
            keep_latest(self.addresses, source, None, most=MAX_ADDRESSES)

    def view(self, system_id: int) -> VehicleView:
        """Return what the client gets of a vehicle."""
        view = self.views.get(system_id)
        if view is None:
            view = self.views[system_id] = VehicleView(self.pace)
        return view

    def forget(self, system_id: int, tasks: Collection[int]) -> None:
        """Forget a vehicle with its ``tasks``; what the client itself said stays known.

        It is introduced again if it comes back.
        """
        self.introduced.discard(system_id)
        self.views.pop(system_id, None)
        self.status_streams.pop(system_id, None)
        self.followed = {each: None for each in self.followed if each not in tasks}
        self._changed = {each: None for each in self._changed if each not in tasks}
        for source in [each for each in self.left_out if each.system_id == system_id]:
            del self.left_out[source]
        self.outlet.forget(system_id)

    # TASK_STATUS: on each change of state, and for active tasks at the interval that it asked for

    def note_change(self, task_id: int) -> None:
        """Note that a task's state changed; telling it twice before it is sent counts once."""
        self._changed[task_id] = None
        if len(self._changed) > MAX_CHANGED:
            shorten(self._changed, MAX_CHANGED)  # a request still shows those tasks
        if self._statuses_from < self.statuses_due:
            self._plan_statuses(self._statuses_from)

    def stream_statuses(self, vehicle: int, interval: float | None, *, now: float) -> None:
        """Stream a vehicle's active task every ``interval`` seconds; None: not at all."""
        self.status_streams.pop(vehicle, None)
        if interval is not None:
            self.status_streams[vehicle] = min(max(interval, SHORTEST), LONGEST), now
        self._plan_statuses(now)

    def _plan_statuses(self, at: float) -> None:
        self.statuses_due = min(self.statuses_due, at)
        if at < self._timer.at:
            self._timer.set(at)

    def due_statuses(self, look_at: Callable[[int], Vehicle | None], *, now: float) -> list[int]:
        """Return the tasks to report now; ``look_at`` returns a vehicle, for the streams."""
        due: dict[int, None] = {}
        while self._changed and now >= self._statuses_from:
            if not self._statuses.take(now=now):
                self._statuses_from = now + 1.0 / self._statuses.rate
                break
            task_id = next(iter(self._changed))
            del self._changed[task_id]
            due[task_id] = None
        self.statuses_due = self._statuses_from if self._changed else inf
        for system_id, (interval, next_at) in self.status_streams.items():
            if now >= next_at:
                next_at = max(next_at + interval, now)
                self.status_streams[system_id] = interval, next_at
                vehicle = look_at(system_id)
                running = None if vehicle is None else vehicle.tasks.executor.task_id
                if running is not None:
                    due[running] = None
            self.statuses_due = min(self.statuses_due, next_at)
        return list(due)

    def answer(self, answer: Answer, to: Address) -> None:
        """Send a COMMAND_ACK to the address ``to`` at this endpoint."""
        command, result, param2, source, param1 = answer
        self.outlet.send(m.CommandAck(command, result, param1, param2, *to), source)

    def forward(self, packet: Packet, *, now: float) -> None:
        """Forward a vehicle's packet, unless its stream is above this client's rate."""
        system_id, component = packet.source
        if system_id not in self.introduced:
            if packet.message_id != m.Heartbeat.id or component != AUTOPILOT:
                return
            self.introduced.add(system_id)
        number, is_silent = packet.message_id, not self.is_heard or self.is_one_of_many
        if number == m.Heartbeat.id or not (
            is_silent
            or (number in STREAMED and not self.view(system_id).passes(component, number, now=now))
        ):
            self.outlet.forward(packet)
        else:
            self.outlet.withhold(packet.source)

    def tell(self, text: str, severity: MavSeverity, source: Address, *, now: float) -> None:
        """Send a STATUSTEXT of a vehicle's task server; one below WARNING within the rate limit."""
        is_known = source.system_id in self.introduced or self.uses_dialect
        if not self.is_heard or not is_known:
            return
        if severity > MavSeverity.WARNING and not self._texts.take(now=now):
            self.left_out[source] = self.left_out.get(source, 0) + 1
            return
        self._say(text, severity, source)

    def tell_refusal(self, text: str, source: Address, *, now: float) -> None:
        """Send the reason of a refusal; to a ground station that keeps trying, only once.

        There it is an ERROR: QGroundControl shows that in a box, anything less in a list only.
        """
        if self.uses_dialect:  # a script gets the text of each refusal
            self.tell(text, MavSeverity.WARNING, source, now=now)
            return
        said_at = self._refusals_told.get((source, text), -inf)
        if now - said_at < REFUSAL_EACH:
            return
        keep_latest(self._refusals_told, (source, text), now, most=MAX_REFUSALS_TOLD)
        self.tell(text, MavSeverity.ERROR, source, now=now)

    def answer_in_words(self, text: str, source: Address, *, now: float) -> None:
        """Send a STATUSTEXT of an address that the client has just named, within the rate limit."""
        if self._texts.take(now=now):
            self._say(text, MavSeverity.ERROR, source)

    def tell_what_was_left_out(self, *, now: float) -> None:
        """Send one text for each source: the number of its dropped texts."""
        while self.left_out and self._texts.take(now=now):
            source, count = self.left_out.popitem()
            self._say(f"{count} messages dropped: see mav-tasks log", MavSeverity.INFO, source)

    def _say(self, text: str, severity: MavSeverity, source: Address) -> None:
        self._text_id = self._text_id % 0xFFFF + 1
        for chunk in statustext.chunks(severity, text, text_id=self._text_id):
            self.outlet.send(chunk, source)
