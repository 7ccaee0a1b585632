"""What is sent to one vehicle, and its answers: setpoints, our and clients' commands, rates.

It decides nothing but the order in which packets leave.
"""

from collections.abc import Callable, Hashable
from math import inf

from mav_tasks.config.settings import Watch
from mav_tasks.engine.inputs import Outgoing, Place
from mav_tasks.engine.packets import PacketSender
from mav_tasks.engine.policy import row_of_command
from mav_tasks.engine.services import loss_failsafe, statustext
from mav_tasks.engine.services.commands import Answered, CommandSender, Standing
from mav_tasks.engine.services.interval_requester import IntervalRequester
from mav_tasks.engine.services.missions import Done, Item, MissionUploader
from mav_tasks.engine.services.offboard import OffboardControl, is_request_of
from mav_tasks.engine.services.orders import Phase, moves
from mav_tasks.engine.services.own_parameters import OwnParameters
from mav_tasks.engine.services.persona import Persona
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import target_of
from mav_tasks.mavlink.enums import MavCmd, MavResult, MavSeverity
from mav_tasks.mavlink.packet import Packet
from mav_tasks.tasks.halts import Halts

ASK_WHICH = 5  # times that a vehicle is asked for AUTOPILOT_VERSION
ASK_WHICH_EACH = 3.0  # s
SPARE_US = 200_000.0  # between two positions on a link that is not in use, but may be soon
SHOW = 0.25  # s in which a requested heartbeat must come; the next regular one is not far
ASK_TO_SHOW = 3  # times in a row that a vehicle may leave that request unanswered
#: commands after which clients wait for a heartbeat that shows the result
SHOWN = frozenset({MavCmd.DO_SET_MODE, MavCmd.DO_SET_STANDARD_MODE, MavCmd.COMPONENT_ARM_DISARM})

#: the task of an act, and its step
ActKey = tuple[int, int]


class VehicleRequests:
    """Sends to one vehicle, and holds our offboard control of it."""

    def __init__(
        self,
        target: Address,
        persona: Persona,
        outlet: PacketSender,
        *,
        source: Address,
        halts: Halts,
        watch: Watch,
        now: float,
    ) -> None:
        self._target = target
        self._halts = halts
        self._persona = persona
        self._source = source
        self._watch = watch
        self._outlet = outlet
        #: the link and endpoint at which the vehicle is reached
        self.place: Place = outlet.link, outlet.peer
        self._sender = CommandSender(source)
        #: the answers to clients' commands; who hands them on clears it
        self.answers: list[Answered] = []
        self._uploader = MissionUploader(target)
        self._performed: set[int] = set()  # command ids that plans have ordered
        #: the plans' commands refused or not answered; who reports them clears it
        self.unperformed: list[Answered] = []
        self._acts: dict[ActKey, m.CommandLong | m.CommandInt] = {}  # not answered yet
        self.told_at = -inf  # when the last act was told
        #: the answers to acts; who reports them clears it
        self.acted: list[tuple[ActKey, Answered]] = []
        self.control = OffboardControl(target, persona, self._sender, watch)
        self.intervals = IntervalRequester(now=now)
        #: what the vehicle is asked for, how it stops by itself, turns and drives
        self.parameters = OwnParameters(target, persona)
        self._shows = ASK_TO_SHOW  # how many more times it is asked for a heartbeat
        #: home may have moved since the vehicle said it last: by an arming or a DO_SET_HOME
        self.is_home_old = False
        self._versions_asked = 0
        self._ask_version_at = now
        #: whether the vehicle has sent its identity
        self.is_identified = False
        #: zero and HOLD as packets, for an exit on which nothing can be computed any more
        self._last_words = self._prepare_last_words()

    def apply(self, watch: Watch) -> None:
        """Apply new settings; pending requests keep their time limits."""
        self._watch = watch
        self.control.apply(watch)

    def adopt(self, persona: Persona) -> None:
        """Switch to another persona of the same autopilot; not to be called while it is driven."""
        self._persona = persona
        self.control.adopt(persona)
        self._last_words = self._prepare_last_words()

    def move_to(self, outlet: PacketSender) -> None:
        """Send to another endpoint from now on."""
        self._outlet, self.place = outlet, (outlet.link, outlet.peer)
        self._last_words = self._prepare_last_words()

    def shut(self) -> None:
        """Send the vehicle nothing any more: another gateway may have it."""
        self.move_to(self._outlet.shut())

    def receive(self, ack: m.CommandAck, *, component: int, now: float) -> None:
        """Process an answer of the vehicle."""
        self._sender.receive(ack, component=component, now=now)
        self.flush(now=now)

    def forward(self, packet: Packet) -> None:
        """Forward a client's packet that needs no answer."""
        self._outlet.inject(packet)

    def ask_to_show(self, *, now: float) -> None:
        """Ask for a heartbeat now: somebody waits to see its mode or arming."""
        if not self._shows:
            return
        self._sender.request(self._message_request(m.Heartbeat.id), now=now, give_up_after=SHOW)
        self.flush(now=now)

    def relay(
        self,
        packet: Packet,
        message: m.Message,
        origin: Hashable,
        *,
        component: int,
        command: int,
        standing: Standing,
        immediate: bool,
        now: float,
    ) -> None:
        """Forward a client's command; its answer comes into ``answers``.

        One that might move the vehicle is not sent after a halt.
        """
        self.is_home_old |= command == MavCmd.DO_SET_HOME
        term = self._halts.term
        may_move = not row_of_command(command).passed_on.passes_under_stop
        self._sender.relay(
            packet,
            message,
            origin,
            component=component,
            command=command,
            standing=standing,
            now=now,
            give_up_after=self._watch.forward_answer,
            immediate=immediate,
            is_outdated=lambda: may_move and self._halts.term != term,
        )
        self.flush(now=now)

    def perform(self, command: m.CommandLong | m.CommandInt, *, now: float) -> None:
        """Send a command that a plan orders, and repeat it until it is answered or given up."""
        self._performed.add(command.command)
        self.is_home_old |= command.command == MavCmd.DO_SET_HOME
        self._sender.request(command, now=now, give_up_after=self._watch.ask_vehicle)
        self.flush(now=now)

    def act(
        self,
        key: ActKey,
        command: m.CommandLong | m.CommandInt,
        *,
        component: int,
        give_up_after: float,
        is_outdated: Callable[[], bool],
        now: float,
    ) -> None:
        """Send a command once, because a vehicle carries out each copy.

        ``component`` answers it. It is not sent if it is outdated when its turn comes.
        """
        self.drop_acts(key[0])  # its answer would be to an earlier step
        self._acts[key], self.told_at = command, now
        self.is_home_old |= command.command == MavCmd.DO_SET_HOME
        self._sender.once(
            command,
            component=component,
            now=now,
            give_up_after=give_up_after,
            is_outdated=is_outdated,
        )
        self.flush(now=now)

    def drop_acts(self, task_id: int | None = None) -> None:
        """Forget the acts of a task, None: of all; what is not sent yet will not be."""
        for key in [key for key in self._acts if task_id in (None, key[0])]:
            self._sender.drop(self._acts.pop(key))

    def end_performing(self) -> None:
        """Stop sending what plans have ordered, on STOP or a takeover."""
        self.drop_acts()
        for command in self._performed:
            self._sender.withdraw(self._target.component_id, command)
        self._performed.clear()

    def write_plan(
        self, mission_type: int, items: tuple[Item, ...], done: Done, *, now: float
    ) -> None:
        """Upload a plan to the vehicle itself; ``done`` is called with the result."""
        self._uploader.begin(mission_type, items, done, now=now)
        self.flush(now=now)

    def receive_of_plan(self, message: m.Message, *, now: float) -> None:
        """Process the vehicle's part of such an upload."""
        if target_of(message).reaches(self._source):
            self._uploader.receive(message, now=now)
            self.flush(now=now)

    def tell(self, text: str, source: Address) -> None:
        """Send a text to those on the vehicle's side."""
        for chunk in statustext.chunks(MavSeverity.WARNING, text, text_id=1):
            self._outlet.send(chunk, source)

    def send_zero(self) -> None:
        """Send one zero setpoint, whoever drives the vehicle."""
        self._outlet.send(self.control.zero_setpoint(), self._source)

    def send_stand_in(self) -> None:
        """Send one setpoint that asks a vehicle to stand that may be armed at any moment."""
        self._outlet.send(self.control.zero_setpoint(armed=True), self._source)

    def send_zero_and_hold(self) -> None:
        """Send a zero and ask for HOLD, once each, without waiting for an answer."""
        for message in self.control.zero_and_hold():
            self._outlet.send(message, self._source)

    def ask_for_home(self, *, now: float) -> None:
        """Ask where home is now; until the vehicle says it, no return sets out."""
        self.is_home_old = True
        request = self._message_request(m.HomePosition.id)
        self._sender.request(request, now=now, give_up_after=self._watch.ask_vehicle)
        self.flush(now=now)

    def heard_home(self) -> None:
        """Note that the vehicle has said where home is; it counts unless it is being set."""
        self.is_home_old = self._sender.awaits(MavCmd.DO_SET_HOME)

    def ask_for_rates(self, *, now: float) -> None:
        """Ask for the next message interval that is due, if any."""
        if request := self.intervals.next_request(now=now):
            request.target_system, request.target_component = self._target
            self._sender.request(request, now=now, give_up_after=self._watch.ask_vehicle)
            self.flush(now=now)

    def ask_for_parameters(self) -> None:
        """Ask how it stops by itself, how it turns and how fast it drives, until it answers."""
        for request in self.parameters.requests():
            self._outlet.send(request, self._source)

    def has_not_said_which(self, *, now: float) -> bool:
        """Return whether it was asked for its identity often enough, and did not answer."""
        is_asked = self._versions_asked >= ASK_WHICH and now >= self._ask_version_at
        return is_asked and not self.is_identified

    def ask_which(self, *, now: float) -> None:
        """Ask for the identity of the vehicle, a few times, until it answers."""
        if self.is_identified or self._versions_asked >= ASK_WHICH or now < self._ask_version_at:
            return
        self._versions_asked += 1
        self._ask_version_at = now + ASK_WHICH_EACH
        request = self._message_request(m.AutopilotVersion.id)
        self._sender.request(request, now=now, give_up_after=self._watch.ask_vehicle)
        self.flush(now=now)

    def ask_which_again(self) -> None:
        """Ask for the identity again: another vehicle may be there, or it may hear us again."""
        self._shows = max(self._shows, 1)
        self.is_identified = False
        self._versions_asked, self._ask_version_at = 0, -inf

    def ask_there(self, outlet: PacketSender, *, is_same: bool) -> None:
        """Ask at another place which vehicle is there; once that is known, for what guides it."""
        for number in (m.LocalPositionNed.id, m.Attitude.id) if is_same else ():
            request = self._message_request(number)
            request.command, request.param2 = MavCmd.SET_MESSAGE_INTERVAL, SPARE_US
            outlet.send(request, self._source)
        if not is_same:
            outlet.send(self._message_request(m.AutopilotVersion.id), self._source)

    def next_deadline(self) -> float:
        """Return when a command is to be repeated or given up, s; inf without one."""
        uploader = self._uploader
        return min(self._sender.next_deadline(), uploader.again_at, uploader.give_up_at)

    def handle_deadline(self, *, now: float) -> None:
        """Repeat or give up what is due."""
        if now >= self.next_deadline():
            self._sender.handle_deadline(now=now)
            self._uploader.handle_deadline(now=now)
            self.flush(now=now)

    def flush(self, *, now: float) -> bool:
        """Send what the services have queued, and hand out the answers that came.

        Return whether a setpoint leaves.
        """
        setpoints = self.control.take_messages()
        outgoing, answers = self._sender.take()
        if self.control.holds_first:
            outgoing += setpoints
        else:
            outgoing = [*setpoints, *outgoing]
        outgoing += self._uploader.take()
        for item in outgoing:
            if isinstance(item, Packet):
                self._outlet.inject(item)
            else:
                # zeros stay behind queued setpoints; HOLD stops the vehicle whatever those say
                is_command = isinstance(item, m.CommandLong | m.CommandInt)
                is_first = is_command and self.control.phase is Phase.STOPPING
                until = now + self._watch.motion_fresh if moves(item) else inf
                self._outlet.send(item, self._source, first=is_first, until=until)
        for answer in answers:
            self._dispatch(answer, now=now)
        return bool(setpoints)

    def _message_request(self, wanted: int) -> m.CommandLong:
        return m.CommandLong(*self._target, MavCmd.REQUEST_MESSAGE, 0, wanted, 0, 0, 0, 0, 0, 0)

    def _dispatch(self, answer: Answered, *, now: float) -> None:
        result = None if answer.ack is None else answer.ack.result
        if answer.origin is not None:
            self.answers.append(answer)
        elif is_request_of(answer):
            self.control.answered(answer, now=now)
        elif key := next((key for key, act in self._acts.items() if act is answer.request), None):
            del self._acts[key]
            self.acted.append((key, answer))
        elif answer.command in self._performed:
            if result != MavResult.ACCEPTED:
                self.unperformed.append(answer)
        elif answer.command == MavCmd.REQUEST_MESSAGE:
            self._note_shown(answer)
        elif answer.command == MavCmd.SET_MESSAGE_INTERVAL:
            accepted = None if result is None else result == MavResult.ACCEPTED
            self.intervals.answered(accepted=accepted)
        if answer.command in SHOWN and result == MavResult.ACCEPTED:
            self.ask_to_show(now=now)
        if answer.command == MavCmd.DO_SET_HOME:
            self.ask_for_home(now=now)

    def _note_shown(self, answer: Answered) -> None:
        """Stop asking for heartbeats if it does not send them on request.

        Clients' requests wait until our unanswered request is given up.
        """
        request = answer.request
        if not isinstance(request, m.CommandLong) or request.param1 != m.Heartbeat.id:
            return
        if answer.ack is None:
            self._shows -= 1
        else:
            self._shows = ASK_TO_SHOW if answer.ack.result == MavResult.ACCEPTED else 0

    @property
    def emergency_stop_packets(self) -> tuple[Outgoing, ...]:
        """The prepared packets that stop the vehicle if the engine fails.

        A PX4 car that follows setpoints, and whose failsafe makes it stand, gets a zero only: it
        brakes until the failsafe comes, and then stands. HOLD while it drives would let it go back
        to that place in a loop: 7 to 12 m at up to 2.6 m/s from 1.5 m/s, instead of 1.3 m (PX4
        1.17.0, SITL). One that follows none, as in a client's "go to", gets HOLD.
        """
        rolls_in_hold = self._persona.brakes_by_setpoints and self.control.follows
        said = self.parameters
        if rolls_in_hold and loss_failsafe.is_said(said.values) and not said.fault[1]:
            return self._last_words[1:]  # all but HOLD, which comes first for one with a failsafe
        return self._last_words

    def _prepare_last_words(self) -> tuple[Outgoing, ...]:
        queue: list[Outgoing] = []
        spare = self._outlet.sibling(queue)
        for message in self.control.zero_and_hold():
            # a zero stays behind queued setpoints; HOLD stops the vehicle whatever those say
            spare.send(message, self._source, first=isinstance(message, m.CommandLong))
        return tuple(queue)
