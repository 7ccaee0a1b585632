"""One rule, judged by the rover's true pose: a halted rover stands until it is released.

After an acknowledged halt (STOP, pause, HOLD, disarm; a switch at the rover; cancel of the active
task) the rover stops within its stopping distance. It stays there until a go request that was
*first sent* after the server had read the halt, or that the sender of the halt sent after it. After
STOP only *continue* is such a request; a submission never is. A refused request releases nothing.

The judge sees clients' packets when the server reads them, answers when they are sent, and the
rover's body, but none of the server's own state. It does not judge a rover that receives nothing,
or that a person or another station drives.
"""

from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import hypot, remainder, tau

from rover_sim.body import BodyState
from rover_sim.personas import Mode
from rover_sim.vehicle import Vehicle
from tests.kit.words import CLEAR, Kind, Word

ACCEPTED, IN_PROGRESS = 0, 5  # MAV_RESULT
STOPS_WITHIN = 2.5  # s, from 1 m/s, with repeated requests over a net that loses a fifth
SLACK, SLACK_ANGLE = 0.3, 0.4  # m, rad; beyond speed times STOPS_WITHIN while braking
MOVED, TURNED = 0.1, 0.2  # m, rad, after standstill
UNHEARD = 6.0  # s after a fault on the way to the rover
LATE = 1.0  # s in transit
FLIGHT = 0.1  # s, longer than the net's delay: requests of two clients may cross within it
OLD = 0.6  # s; a go request that a stalled server did not read for so long releases nothing
UNDONE = 3.0  # s after standstill, until a mode or an arming that came late is undone
MODE_TAKES = 0.5  # s from a mode request's arrival until the rover is in the mode
LED = frozenset({Mode.GUIDED, Mode.AUTO, Mode.RTL})  # a manual mode is left to the person there
BY_ITSELF = frozenset({Mode.MANUAL, Mode.POSITION, Mode.AUTO, Mode.RTL})
REMEMBERED = 50  # go requests
WEIGHTS = {Kind.WISH: 1, Kind.MOTION: 2, Kind.GO: 3}
CONTINUE, CANCEL, STOP, HOLD = "continue", "cancel", "STOP", "HOLD"
SWITCHED = "HOLD at the rover"  # by a person
STALLED = "stall"  # of the server, which holds what drove


@dataclass(frozen=True, slots=True)
class Broken:
    """A breach of the rule: the halt, and the likeliest older request that was read after it."""

    at: float
    halt: str
    since: str
    moved: float  # m
    turned: float  # rad

    @property
    def kind(self) -> str:
        """The breach without its figures."""
        return f"{self.halt}, then {self.since}"

    def __str__(self) -> str:
        moved = f"moved {self.moved:.2f} m, turned {self.turned:.2f} rad"
        return f"{self.at:.3f} s: {moved}, after {self.kind}"


@dataclass(slots=True)
class _Halt:
    name: str
    word: Word | None  # None: a person at the rover
    read_at: float
    at: float  # of the acknowledgement
    pose: BodyState
    is_stop: bool
    has_stood: bool = False
    since: str = "no word"  # the likeliest request since then that does not end the halt
    weight: int = 0  # of ``since``
    pauses: bool = True  # False: later submissions may drive, after a HOLD without a task
    fresh: set[tuple[str, int]] = field(default_factory=set)  # unanswered go requests

    def note(self, word: Word, text: str) -> None:
        """Keep a possible cause of later motion; a go request outranks all others."""
        weight = WEIGHTS[word.kind]
        if weight >= self.weight:
            self.weight, self.since = weight, text

    def note_older(self, word: Word, *, now: float) -> None:
        """Keep a request that is older than the halt."""
        how = "a copy of an older" if word.is_copy else "an older"
        late = " that was late" if now - word.first_sent > LATE else ""
        self.note(word, f"{how} {word.name}{late}")


@dataclass(slots=True)
class _Go:
    word: Word
    read_at: float
    granted: bool | None = None  # None: unanswered


class Halts:
    """Judges one rover."""

    def __init__(
        self, vehicle: Vehicle, system_id: int, *, stops_within: float = STOPS_WITHIN
    ) -> None:
        self.system_id = system_id
        self._stops_within = stops_within
        self._vehicle = vehicle
        self._halt: _Halt | None = None
        self._suspended: _Halt | None = None  # a request that may still be refused ended it
        #: unanswered requests of one step; None: one that is too late
        self._asked: dict[tuple[str, int], deque[tuple[Word | None, float]]] = {}
        self._gos: deque[_Go] = deque(maxlen=REMEMBERED)  # the latest go requests
        self._disturbed_at = -1e9
        self._mode = vehicle.autopilot.mode
        self._mode_sent_at = -1e9  # when a mode request of the server reached the rover
        self._server_began_at = -1e9
        self._passed: dict[int, float] = {}  # when clients' commands reached the rover
        self._pauses = True  # of the last halt
        self._wished_at = -1e9  # when the server read the latest submission
        self._is_by_itself = False  # in a mode of its own, which the server did not request
        self.halted: Counter[str] = Counter()  # by name
        self.refused: Counter[str] = Counter()  # go requests
        self.in_flight = 0  # go requests that crossed a halt in transit
        self.broken: list[Broken] = []

    def __repr__(self) -> str:
        return f"Halts({self.system_id}, {self._halt})"

    @property
    def in_force(self) -> str:
        """The name of the halt that holds the rover, "" for none."""
        return "" if self._halt is None else self._halt.name

    # inputs

    def disturb(self, until: float) -> None:
        """Note that the rover may not hear the server until then."""
        self._disturbed_at = max(self._disturbed_at, until)

    def person(self, name: str, *, drives: bool, now: float) -> None:
        """Note that a person at the rover turned its switch, or armed or disarmed it.

        With a mode request of the server under way, nobody can tell who has set HOLD.
        """
        self._halt = self._suspended = None
        if not drives and (name != SWITCHED or now - self._mode_sent_at > MODE_TAKES):
            self._begin(name, None, read_at=now, now=now)

    def server_began(self, *, now: float) -> None:
        """Note that another server runs: it does not know what clients asked for before."""
        self._server_began_at = now

    def pushed(self) -> None:
        """Note that another station sent the rover somewhere, bypassing the server."""
        self._halt = self._suspended = None

    def mode_arrived(self, *, now: float) -> None:
        """Note that a mode request of the server reached the rover."""
        self._mode_sent_at = now
        if self.in_force == SWITCHED and self._halt and now - self._halt.at <= MODE_TAKES:
            self._halt = None

    def passed(self, command: int, *, now: float) -> None:
        """Note that a client's command reached the rover; it counts even if its answer is lost."""
        self._passed[command] = now
        halt = self._halt
        if halt is not None and any(
            go.word.command == command and self._ends(go.word, halt) for go in self._gos
        ):
            self._halt = None

    def began_task(self) -> None:
        """Note that another task starts; a previous cancel does not apply to it."""
        if self._halt is not None and self._halt.name == CANCEL:
            self._halt = None

    def read(
        self, word: Word, *, running: int | None, has_tasks: bool, waited: float, now: float
    ) -> None:
        """Note that the server reads a client's request; ``running`` is the id of the active task.

        ``has_tasks``: some task of the rover is not over. ``waited``: s since the packet's arrival.
        """
        if word.system_id not in (0, self.system_id):
            return
        if word.kind is Kind.HALT:
            of_what_runs = running is not None and word.param1 in (0.0, float(running))
            if word.name != CANCEL or of_what_runs:
                self._await(word, word, now=now)
                self._pauses = word.name != HOLD or has_tasks
        elif word.kind in (Kind.GO, Kind.MOTION):
            self._read_go(word, is_late=waited > OLD, now=now)
        elif word.kind is Kind.WISH:
            self._wished_at = now
            self._read_wish(word)
        elif word.command == CLEAR and self.in_force == STALLED:
            self._halt = None  # what was held is over

    def answered(self, peer: str, command: int, result: int, *, now: float) -> None:
        """Note the server's answer to a client."""
        key = peer, command
        is_granted = result in (ACCEPTED, IN_PROGRESS)
        asked = self._asked.get(key)
        if not asked:
            return
        # a halt is answered when it is kept, later than a refusal of what was read with it
        answered = min(asked, key=lambda each: not is_granted and _is_halt(each[0]))
        asked.remove(answered)
        word, read_at = answered
        if word is None:
            return
        if word.kind is Kind.HALT:
            if is_granted:
                self._begin(word.name, word, read_at=read_at, now=now)
            return
        is_granted |= self._passed.get(command, -1e9) >= read_at
        if not is_granted:
            self.refused[word.name] += 1
        for go in self._gos:
            if go.word is word:
                go.granted = is_granted
        self._settle(key, is_granted=is_granted)

    def look(self, now: float) -> Iterator[Broken]:
        """Yield a breach of the rule, once per halt."""
        self._look_at_mode(now)
        halt = self._halt
        if halt is None:
            return
        truth = self._vehicle.truth
        is_unheard = self._is_unheard(now)
        if is_unheard or self._is_by_itself:
            halt.pose = truth
        moved = hypot(truth.north - halt.pose.north, truth.east - halt.pose.east)
        turned = abs(remainder(truth.yaw - halt.pose.yaw, tau))
        settled = self._stops_within + UNDONE
        if not is_unheard and now - halt.at > settled and (shown := self._is_undone(halt)):
            far, halt.since = True, shown
        elif now - halt.at <= self._stops_within:
            speed = hypot(halt.pose.forward_speed, halt.pose.lateral_speed)
            far = moved > speed * self._stops_within + SLACK
            far |= turned > abs(halt.pose.yaw_rate) * self._stops_within + SLACK_ANGLE
        elif not halt.has_stood:
            halt.has_stood, halt.pose, far = True, truth, False
        else:
            far = moved > MOVED or turned > TURNED
        if far:
            found = Broken(now, halt.name, halt.since, moved, turned)
            self.broken.append(found)
            self._halt = None  # report it once
            yield found

    # internals

    def _begin(self, name: str, word: Word | None, *, read_at: float, now: float) -> None:
        self.halted[name] += 1
        is_stop = name == STOP or (self._halt is not None and self._halt.is_stop)
        halt = _Halt(name, word, read_at, now, self._vehicle.truth, is_stop)
        halt.pauses = is_stop or self._pauses
        newer = [go for go in self._gos if go.granted is not False and self._ends(go.word, halt)]
        self._halt = self._suspended = None
        for go in self._gos:
            if go.read_at >= read_at and not self._ends(go.word, halt):
                halt.note_older(go.word, now=now)
        if not halt.pauses and self._wished_at >= read_at:
            return  # it came after the HOLD of a rover without tasks, which pauses none
        if not newer:
            self._halt = halt
        elif not any(go.granted for go in newer):
            halt.fresh.update((go.word.peer, go.word.command) for go in newer)
            self._suspended = halt

    def _await(self, word: Word, judged: Word | None, *, now: float) -> None:
        """Expect an answer; those to requests that are read together come in their order."""
        asked = self._asked.setdefault((word.peer, word.command), deque())
        if asked and asked[-1][1] < now:
            asked.clear()
        asked.append((judged, now))

    def _read_go(self, word: Word, *, is_late: bool, now: float) -> None:
        if word.command:
            self._await(word, None if is_late else word, now=now)
        if word.command and not is_late:
            self._gos.append(_Go(word, now))
        halt = self._halt or self._suspended
        if halt is None or (halt.is_stop and word.name != CONTINUE):
            return
        if is_late or not self._ends(word, halt):
            halt.note_older(word, now=now)
            return
        self.in_flight += _passed(word, halt)
        if word.command:
            halt.fresh.add((word.peer, word.command))
            self._suspended, self._halt = halt, None
        else:
            self._halt = self._suspended = None

    def _read_wish(self, word: Word) -> None:
        halt = self._halt or self._suspended
        if halt is None:
            return
        if not halt.pauses and self._ends(word, halt):
            self._halt = self._suspended = None
        else:
            halt.note(word, f"a {'copy of a ' if word.is_copy else ''}{word.name}")

    def _settle(self, key: tuple[str, int], *, is_granted: bool) -> None:
        halt = self._suspended
        if halt is None or key not in halt.fresh:
            return
        halt.fresh.discard(key)
        if is_granted:
            self._suspended = None
        elif not halt.fresh:  # all were refused: the halt remains
            self._suspended, self._halt = None, halt

    def _ends(self, word: Word, halt: _Halt) -> bool:
        """Return whether a go request, if granted, is newer than a halt."""
        if halt.is_stop and word.name != CONTINUE:
            return False
        if word.first_sent > halt.read_at:
            return True
        if halt.word is not None and halt.word.peer == word.peer:
            return word.order > halt.word.order
        return _passed(word, halt)

    def _is_undone(self, halt: _Halt) -> str:
        """Return what the rover shows that a client's halt had ended, "" for nothing."""
        autopilot = self._vehicle.autopilot
        if halt.word is None or halt.at < self._server_began_at or not autopilot.armed:
            return ""
        if halt.name in (HOLD, STOP) and autopilot.mode in LED and not self._is_by_itself:
            return f"it shows {autopilot.mode.name}"
        return "it is armed" if halt.name == "disarm" else ""

    def _look_at_mode(self, now: float) -> None:
        mode = self._vehicle.autopilot.mode
        if mode is not self._mode:
            self._mode = mode
            by_server = now - self._mode_sent_at <= MODE_TAKES
            self._is_by_itself = mode in BY_ITSELF and not by_server

    def _is_unheard(self, now: float) -> bool:
        faults = self._vehicle.autopilot.faults
        if faults.deaf or faults.refuse_mode:
            self._disturbed_at = max(self._disturbed_at, now)
        return now - self._disturbed_at <= UNHEARD


def _is_halt(word: Word | None) -> bool:
    return word is not None and word.kind is Kind.HALT


def _passed(word: Word, halt: _Halt) -> bool:
    """Return whether another client's request was in transit when the halt was read."""
    of_another = halt.word is None or halt.word.peer != word.peer
    is_older = word.first_sent <= halt.read_at
    return of_another and is_older and not word.is_copy and word.first_sent > halt.read_at - FLIGHT
