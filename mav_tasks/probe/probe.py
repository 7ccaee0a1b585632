"""The probe of one rover as one pure object: packets and time in, packets and findings out."""

from dataclasses import dataclass

from mav_tasks.config.settings import Identity, Turning, Watch
from mav_tasks.engine.services.loss_failsafe import fault_in
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.packet import Packet
from mav_tasks.probe.conversation import Conversation
from mav_tasks.probe.drive_controller import DriveController, DriveEnded
from mav_tasks.probe.driving_area import DrivingArea
from mav_tasks.probe.failsafe import NotSet, set_failsafe
from mav_tasks.probe.findings import Drive, Findings
from mav_tasks.probe.parameters import loss_time_of, own_parameters_of
from mav_tasks.probe.questions import (
    ask_everything,
    ask_rates,
    give_rates_back,
    identify,
    listen,
    meet,
)
from mav_tasks.probe.steps import Steps, Wait, Walk
from mav_tasks.probe.trials import Trials

FRESH_ENOUGH = 5.0  # Hz of position and attitude, below which it is not driven
DRIVEN_TYPES = frozenset({10, 11})  # MAV_TYPE: ground rover, surface boat
SETTER = Address(244, 191)  # beside the address of scripts
#: a rover at rest says up to 0.07 m/s (ArduPilot 4.6.3, PX4 1.17); none is driven slower than 0.1
AT_REST = Watch(still_speed=0.08)
NEEDED = ("LOCAL_POSITION_NED", "ATTITUDE")


class NothingHeard(Exception):
    """No rover is at the other end; the text says for how long it was waited."""


class Occupied(Exception):
    """Somebody else is there, by whom the rover is driven, or may be; the text says who."""


class Interrupted(Exception):
    """Whoever started it wants it to end."""


@dataclass(frozen=True, slots=True)
class Options:
    drive: bool = False
    set_failsafe: bool = False  # and nothing else
    speed: float = 0.3  # m/s
    system_id: int | None = None  # None: the first rover that is heard
    find_within: float = 10.0  # s


class Probe:
    """Asks, and with ``options.drive`` drives; then gives back what it has changed."""

    def __init__(self, options: Options, *, now: float) -> None:
        identity = Identity()
        source = Address(identity.system_id, identity.component_id)
        if options.set_failsafe:  # also through a server, which has that address itself
            source = SETTER
        self.findings = Findings()
        self.talk = Conversation(source, system_id=options.system_id, watch=AT_REST, now=now)
        self._options = options
        self._has_rates = False
        self._is_clearing_up = False
        self._walk = Walk(self._run())
        #: what it is about, in words
        self.stage = "waiting for a rover"
        #: why it ended before its time
        self.error: Exception | None = None

    def __repr__(self) -> str:
        return f"Probe({self.talk!r}, {self._walk!r})"

    @property
    def is_over(self) -> bool:
        """Whether it has done all that it does; ``take_packets`` once more."""
        return self._walk.is_over

    def receive(self, packet: Packet, *, now: float) -> None:
        self.talk.receive(packet, now=now)
        self._walk.go_on(now=now)

    def handle_deadline(self, *, now: float) -> None:
        """Do what is due; may come for nothing."""
        self.talk.handle_deadline(now=now)
        self._walk.go_on(now=now)

    def next_deadline(self) -> float:
        at = self._walk.next_deadline()
        return self.talk.next_deadline() if at is None else min(at, self.talk.next_deadline())

    def take_packets(self) -> list[bytes]:
        """Return what is to be sent since the last call, in order."""
        return self.talk.take_packets()

    def interrupt(self, words: str, *, now: float) -> None:
        """End, but leave the rover as it is to be left; what that takes goes on."""
        self.talk.now = now
        if not self._is_clearing_up:
            self._walk.interrupt(Interrupted(words), now=now)

    def emergency_stop_packets(self) -> list[bytes]:
        """Return what makes a rover in our hands stand, for an end that cannot wait."""
        return self.talk.emergency_stop_packets()

    def _run(self) -> Steps[None]:
        try:
            yield from self._find()
            if self._options.set_failsafe:
                yield from self._set_failsafe()
                return
            yield from self._look()
            if self._options.drive:
                yield from self._drive()
        except (NothingHeard, Occupied, Interrupted, NotSet) as error:
            self.error = error
        self._is_clearing_up = True
        if self._has_rates:
            yield from give_rates_back(self.talk, self.findings)

    def _find(self) -> Steps[None]:
        talk, within = self.talk, self._options.find_within
        yield Wait(lambda: talk.rover is not None, within)
        if talk.rover is None:
            which = self._options.system_id
            who = "a rover" if which is None else f"rover {which}"
            raise NothingHeard(f"no heartbeat from {who} within {within:g} s")

    def _set_failsafe(self) -> Steps[None]:
        """It may be asked through a task server, and while somebody drives: nothing moves by it."""
        talk, findings = self.talk, self.findings
        self.stage = f"reading the loss failsafe of rover {talk.target.system_id}"
        meet(talk, findings)
        findings.is_rover = findings.vehicle_type in DRIVEN_TYPES
        yield from identify(talk, findings)
        yield from set_failsafe(talk, findings)

    def _look(self) -> Steps[None]:
        talk, findings = self.talk, self.findings
        self.stage = f"listening to rover {talk.target.system_id} and querying it"
        yield from listen(talk, findings)
        findings.is_rover = findings.vehicle_type in DRIVEN_TYPES
        self._leave_if_occupied()
        yield from ask_everything(talk, findings)
        self._has_rates = True
        yield from ask_rates(talk, findings)
        findings.armed = talk.armed
        self._leave_if_occupied()

    def _leave_if_occupied(self) -> None:
        why = self.talk.others.why_leave()
        if why:
            raise Occupied(why)

    def _drive(self) -> Steps[None]:
        talk, persona = self.talk, self.talk.persona
        drive = self.findings.drive = Drive()
        why, motion = self._why_not_drive(), talk.motion.latest()
        if why or persona is None or motion is None:
            drive.ended = f"not driven: {why}"
            return
        found = self.findings
        area = DrivingArea.about(motion.pose, turning=found.turning, radius=found.turning_radius)
        controller = DriveController(talk, persona, drive, area)
        _, keeps_moving = fault_in(own_parameters_of(talk, persona).values)
        if keeps_moving:  # the server reads that itself: no profile is to outlive its cure
            drive.loss_note = f"not tried: {keeps_moving}"
        self.stage = f"driving within {area.half:g} m of its place: keep clear; Ctrl-C stops it"
        try:
            yield from controller.take()
            trials = Trials(
                controller,
                persona,
                drive,
                speed=self._options.speed,
                loss_time=loss_time_of(found),
                is_car=found.turning == Turning.STEERED.value,
            )
            yield from trials.run(with_loss=not keeps_moving)
        except DriveEnded as end:
            drive.ended = str(end)
        except Interrupted as error:
            drive.ended, self.error = str(error), error
        self._is_clearing_up = True
        yield from controller.give_back()

    def _why_not_drive(self) -> str:
        talk, findings = self.talk, self.findings
        motion = talk.motion.latest()
        slow = [rate for rate in findings.rates if rate.name in NEEDED]
        slow = [rate for rate in slow if (rate.granted or 0.0) < FRESH_ENOUGH]
        if talk.others.why_not_drive():
            return talk.others.why_not_drive()
        if talk.persona is None or not findings.is_rover:
            return "the server does not drive this type of rover"
        if talk.armed:
            return "it is armed already"
        if motion is None or talk.now - motion.at > talk.watch.motion_fresh:
            return "its position is unknown or too old"
        if slow:
            each = ", ".join(f"{rate.name} at {rate.granted:.1f} Hz" for rate in slow)
            return f"{each}: too slow to drive by"
        if motion.speed >= talk.watch.still_speed:
            return "it is moving"
        return ""
