"""Watches all traffic between clients, server and one rover, and checks rules that always hold.

Rules about the server's actions are judged when a packet leaves it, against the packets that had
reached it by then: it is not to blame for a bad net. protocol.md, sections 6 and 7:

- a setpoint is finite. A moving one, from any sender, goes only to a rover seen armed. Ours goes
  only in our mode, after a zero in that mode, on position and attitude that came at most 0.3 s
  ago and left the rover at most 0.4 s ago: its clock is known to a tenth of a second
- order, ArduPilot: mode, zero, arm, motion; no arming in any other mode. PX4: HOLD, arm, a second
  of zeros, mode, motion; arming in HOLD only
- control is taken only from HOLD, from our mode, or from MANUAL while disarmed
- motion comes at 20 Hz: no gap without a zero, no burst
- after STOP, zero and HOLD leave in the same step; then nothing that could move the rover passes
  until a client continues
- after a takeover no more setpoints (one zero if the rover's mode did not announce it)
- never two sources of motion

One rule is judged by the rover's true state, when a moving setpoint of ours arrives there: the
rover is armed and in our mode, unless the server could not know of a change yet.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from math import atan2, isfinite, remainder, tau
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import common

from tests.kit.wishes import Latches, Wish, Wishes

SERVER = (250, 191)

FRESH = 0.3  # s
SENT = 0.4  # s
GAP = 0.12  # s between setpoints while driving: 20 Hz, one tick missed
BURST = 4  # moving setpoints in 0.1 s
ENGAGED = 0.2  # s since the last setpoint: the server is driving
NO_AUTOPILOT = 8  # MAV_AUTOPILOT of heartbeats that do not come from an autopilot
OWN_REQUEST = 3.0  # s in which our own request explains a change to HOLD or disarmed
KNOWN = 0.5  # s since the server learned of it: no earlier setpoint is in transit any more
GREETING = (
    4  # zeros in a row that are not driving: a client's OFFBOARD needs two, and may be asked twice
)
BY_CLIENT = 2.5  # s after a client's arm request, in which arming is attributed to it
TWO_SOURCES = 1.0  # s between moving setpoints of two sources
STICKS = 50
INITIALISING = 16  # custom_mode of a booting ArduPilot
SAME_PACKET = 5.0  # s; later, sequence numbers may have restarted, and it is another packet
REMEMBERED = 64  # commands of clients
ROVER_TIMEOUT = 3.0  # s without a setpoint until the rover stops: ArduPilot's; PX4's is 1
ANOTHER_COURSE = 0.05  # rad
ENTERS = 0.3  # s after the OFFBOARD request, until a newer setpoint counts
TURN = 8.0  # s, half a turn at the slowest rate that tasks use here
FAR = 60.0  # s of driving to a place or in a mode of the rover's own

COMMANDS = ("COMMAND_LONG", "COMMAND_INT")
SHOW = "show"  # the request for a heartbeat
SETPOINTS = ("SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT")
MOTION = (*SETPOINTS, "SET_ATTITUDE_TARGET", "SET_ACTUATOR_CONTROL_TARGET", "FOLLOW_TARGET")
BY_HAND = ("MANUAL_CONTROL", "RC_CHANNELS_OVERRIDE")
MOVING_COMMANDS = (16, 17, 18, 19, 20, 21, 22, 34, 115, 192, 209, 213, 300)
STOP, PAUSE_CONTINUE, SET_MODE, ARM, REQUEST = 54003, 193, 176, 400, 512
RELEASE, SKIP = 54013, 2
MISSION_START = 300
REPOSITION = 192
ACK, ACCEPTED = 77, 0
NO_PLACE = 0x7FFFFFFF
LEAD_IN = 0.95  # s of zeros before PX4's OFFBOARD

#: the ids that the rules need; other telemetry is not decoded
WATCHED = {0, 11, 30, 32, 69, 70, 75, 76, 82, 84, 86, 139, 144}


class Ways(NamedTuple):
    """What differs between makes of rover."""

    ours: int  # custom_mode
    hold: int
    manual: frozenset[int]
    arms_in_hold: bool
    sub_modes: bool  # DO_SET_MODE names main and sub mode
    given_back: frozenset[int]  # modes in which a client lets the server drive: return, mission
    throttles: tuple[int, ...] = (0,)  # MANUAL_CONTROL.z of a centred stick

    def mode_of(self, message: Any) -> int:
        """Return the mode that a DO_SET_MODE requests, -1 if it is invalid."""
        if not (0 <= message.param2 < 2**32 and 0 <= message.param3 < 2**32):
            return -1
        if not self.sub_modes:
            return int(message.param2)
        return int(message.param2) << 16 | int(message.param3) << 24


ARDUPILOT_WAYS = Ways(
    15, 4, frozenset({0}), arms_in_hold=False, sub_modes=False, given_back=frozenset({10, 11})
)
PX4_WAYS = Ways(
    6 << 16,
    4 << 16 | 3 << 24,
    frozenset({1 << 16, 3 << 16}),
    arms_in_hold=True,
    sub_modes=True,
    given_back=frozenset({4 << 16 | 4 << 24, 4 << 16 | 5 << 24}),
    throttles=(0, 500),
)


class Reached(NamedTuple):
    """One packet that reached the rover."""

    at: float
    kind: int  # message id
    source: tuple[int, int]


@dataclass
class Observer:
    """Observes the traffic of one rover; ``check`` raises on violations."""

    system_id: int = 1
    ways: Ways = ARDUPILOT_WAYS
    #: for tests that stop the server's clock
    expects_gaps: bool = False
    longest_gap: float = FRESH  # s without set-points, after which motion may go on
    brakes_first: bool = False  # a car, which rolls on in HOLD: a STOP brakes it by setpoints first
    expects_late_modes: bool = False  # from before a halt: zeros go with the HOLD that undoes them
    #: for worlds with several inputs per step, whose order is unknown
    batches: bool = False
    #: returns whether the rover is truly armed and in our mode
    is_ready: Callable[[], bool] = lambda: True
    #: as the server knows it
    armed: bool = False
    mode: int = -1
    stopped: bool = False
    taken_over: bool = False
    violations: list[str] = field(default_factory=list)
    #: setpoints and commands that left the server, from any sender
    driven: list[tuple[float, Any]] = field(default_factory=list)
    #: every packet that reached the rover
    reached: list[Reached] = field(default_factory=list)
    #: until then the rover may move because of packets that reached it, from any sender
    may_move_until: float = -1e9
    #: when the server read the last STOP that is in force
    stopped_at: float = -1e9
    _zeros_left: int = 0
    _newest: tuple[int, float] = (0, -1e9)  # sequence number and arrival of its latest heartbeat
    _wishes: Wishes = field(default_factory=Wishes)
    _zero_in_mode: bool = False
    _unready_since: float | None = None  # of consecutive heartbeats that are not ready
    _position_at: float = -1e9
    _attitude_at: float = -1e9
    _position_sent_at: float = -1e9
    _attitude_sent_at: float = -1e9
    _setpoint_at: float = -1e9
    _zeros_since: float = 1e9
    _in_row: int = 0  # of the server's consecutive setpoints
    _hold_at: float = -1e9
    _stick_hold_at: float = -1e9  # the last request for HOLD because of a stick
    _sticks_at: float = -2e9
    _disarm_at: float = -1e9
    _disarmed_at: float = -1e9  # when another party was seen to have disarmed it
    _mode_at: float = -1e9  # when another mode was last heard
    _hold_wished_at: float = -1e9  # when a client last requested HOLD
    _pause_at: float = -1e9  # when a client last requested a pause
    _greeting_at: float = -1e9  # when a client last requested our mode: zeros may precede it
    _hold_due: float | None = None  # when a zero left that needs a HOLD to explain it
    _client_arms_at: float = -1e9  # through the server, which may be taking control
    _moved_last: bool = False
    _brakes: bool = False  # zeros have followed motion, and nothing since
    _stop_due: tuple[float, set[str]] | None = None
    _is_met: bool = False  # a new server found it in our mode, and set-points brake it before HOLD
    _last_source: tuple[float, tuple[int, int]] | None = None
    _course: float | None = None  # rad, of the last zero-speed setpoint that arrived
    _course_at: float = -1e9  # when that course changed
    _given_to: tuple[int, int] | None = None  # the last requester of our mode

    def __post_init__(self) -> None:
        self._decoder = common.MAVLink(None)
        self._asked: dict[tuple[str, bytes], float] = {}
        self._recent: deque[float] = deque(maxlen=BURST)

    # inputs

    def asked(self, now: float, data: bytes, *, peer: str) -> None:
        """Note that a client's datagram reaches the server."""
        message = self._decode(data)
        if message is None or self._is_for_another(message):
            return
        kind = message.get_type()
        if kind in COMMANDS and message.command != STOP:
            if now - self._asked.get((peer, data), -1e9) <= SAME_PACKET:
                return  # the server ignores a repeated packet
            self._asked[peer, data] = now
            if len(self._asked) > REMEMBERED:
                del self._asked[next(iter(self._asked))]
        if kind in COMMANDS:
            self._see_command_of_client(now, message)
        elif kind == "SET_MODE":
            self._see_wish_of_client(now, message.custom_mode)
        elif kind in BY_HAND and _off_centre(message, self.ways.throttles):
            self._sticks_at = now
            if not self._brakes:  # else it is stopping already, and will be handed back
                self._take_over(now, zeros=1)

    def heard(self, now: float, data: bytes, *, sent_at: float) -> None:
        """Note that a datagram from the vehicles' side reaches the server."""
        message = self._decode(data)
        if message is None or self._is_overtaken(now, data):
            return
        kind = message.get_type()
        source = (message.get_srcSystem(), message.get_srcComponent())
        if source == SERVER or kind in SETPOINTS:
            self._take_over(now, zeros=1)
        elif source == (self.system_id, 1):
            if kind == "HEARTBEAT" and message.autopilot != NO_AUTOPILOT:
                self._see_heartbeat(now, message)
            elif kind == "LOCAL_POSITION_NED":
                self._position_at = now
                self._position_sent_at = max(self._position_sent_at, sent_at)
            elif kind == "ATTITUDE":
                self._attitude_at = now
                self._attitude_sent_at = max(self._attitude_sent_at, sent_at)

    def _is_overtaken(self, now: float, data: bytes) -> bool:
        """Return whether a newer heartbeat of the rover came before this one."""
        if (data[5], data[6], data[7]) != (self.system_id, 1, 0):
            return False
        seq, at = self._newest
        if 0 < (seq - data[4]) % 256 <= 64 and now - at <= 0.5:
            return True
        self._newest = data[4], now
        return False

    def answered(self, now: float, data: bytes) -> None:
        """Note that the server answers a client: a refused request to continue ends nothing."""
        if int.from_bytes(data[7:10], "little") != ACK or data[5] != self.system_id:
            return
        message = self._decoder.decode(bytearray(data))
        left = self._wishes.answered(message.command, is_granted=message.result == ACCEPTED)
        if left is not None:
            self.stopped, self.taken_over = left

    def sent(self, now: float, data: bytes) -> None:
        """Note that the server sends a datagram to the rover."""
        self._check_stop(now)
        message = self._decode(data)
        if message is None:
            return
        kind = message.get_type()
        if kind in SETPOINTS:
            self.driven.append((now, message))
            self._see_setpoint(now, message)
        elif kind in COMMANDS:
            self.driven.append((now, message))
            self._see_command(now, message)
        if self.stopped and not (self.batches and now == self.stopped_at):
            self._check_stopped(now, message)

    def arrived(self, now: float, data: bytes) -> None:
        """Note that a datagram reaches the rover."""
        if len(data) >= 12 and data[0] == 0xFD:
            kind = int.from_bytes(data[7:10], "little")
            self.reached.append(Reached(now, kind, (data[5], data[6])))
        message = self._decode(data)
        if message is None:
            return
        self.may_move_until = max(self.may_move_until, now + self._keeps_moving(message))
        if message.get_type() in SETPOINTS and self._turns(now, message):
            self.may_move_until = max(self.may_move_until, now + ROVER_TIMEOUT)
        source = (message.get_srcSystem(), message.get_srcComponent())
        if self._is_wish_for_our_mode(message):
            self._given_to = source  # the requester of our mode drives from here on
            if self.ways.arms_in_hold:  # a PX4 resumes the last setpoint that it followed
                self.may_move_until = max(self.may_move_until, now + ENTERS)
        if message.get_type() in SETPOINTS and _moves(message):
            if source == SERVER and not self.is_ready() and self._is_known_unready(now):
                self._violation(now, "moving setpoint at a rover known not to be ready for it")
            if self._last_source is not None:
                at, before = self._last_source
                if source not in (before, self._given_to) and now - at < TWO_SOURCES:
                    self._violation(now, f"two sources of setpoints: {before}, {source}")
            self._last_source = (now, source)

    def _is_wish_for_our_mode(self, message: Any) -> bool:
        if message.get_type() == "SET_MODE":
            return int(message.custom_mode) == self.ways.ours
        is_of_mode = message.get_type() in COMMANDS and message.command == SET_MODE
        return is_of_mode and self.ways.mode_of(message) == self.ways.ours

    def server_restarted(self) -> None:
        """Note that a new server starts: it has no knowledge, and drives nothing yet."""
        self.armed, self.mode = False, -1
        self._moved_last = self._zero_in_mode = self._brakes = False

    def meets(self, ways: Ways) -> None:
        """Note that a rover of another make shows itself, of which the server knows nothing."""
        self.ways = ways
        self.server_restarted()

    def check(self, *, now: float = float("inf")) -> None:
        """Raise AssertionError if there were violations."""
        self._check_stop(now)
        assert not self.violations, "\n".join(self.violations)

    @property
    def _due_at_stop(self) -> set[str]:
        return {"zero"} if self._is_met or self.brakes_first else {"zero", "HOLD"}

    # queries

    def sent_since(self, at: float) -> list[str]:
        """Return the server's packets from ``at`` on, in words: zero, move, HOLD, arm, 511, ...

        Its periodic requests for a heartbeat are left out.
        """
        names = [self._name(message) for t, message in self.driven if t >= at]
        return [name for name in names if name != SHOW]

    # rules

    def _see_command_of_client(self, now: float, message: Any) -> None:
        param1 = message.param1
        if message.command == STOP:
            self.stopped, self.taken_over, self.stopped_at = True, False, now
            self._wishes.stopped()
            if self.mode >= 0:  # else it is stopped when it is found
                self._stop_due = (now, self._due_at_stop)
        elif message.command == PAUSE_CONTINUE:
            is_continue = param1 == 1.0
            if param1 == 0.0:
                self._pause_at = now
            elif is_continue:
                self._check_stop(now)
            self._ask(now, Wish(PAUSE_CONTINUE, is_continue, is_continue))
        elif message.command == RELEASE:
            self._ask(now, Wish(RELEASE, ends_stop=False, ends_takeover=message.param2 != SKIP))
        elif message.command == MISSION_START:
            self._ask(now, Wish(MISSION_START, ends_stop=False, ends_takeover=True))
        elif message.command == SET_MODE:
            self._see_wish_of_client(now, self.ways.mode_of(message))
        elif message.command == ARM and message.param1:
            self._client_arms_at = now

    def _ask(self, now: float, wish: Wish) -> None:
        latches = Latches(self.stopped, self.taken_over)
        self.stopped, self.taken_over = self._wishes.asked(now, wish, latches)

    def _see_wish_of_client(self, now: float, mode: int) -> None:
        if mode == self.ways.hold:
            self._hold_wished_at = now
        if mode == self.ways.ours:
            self._greeting_at = now
        if mode == self.ways.hold or mode in self.ways.given_back:
            self.taken_over = False
            self._wishes.taken_over_no_more()

    def _see_heartbeat(self, now: float, message: Any) -> None:
        armed, mode = bool(message.base_mode & 128), int(message.custom_mode)
        if self.mode < 0:
            self._is_met = armed and mode == self.ways.ours
        if self.stopped and self.mode < 0:
            self._stop_due = (now, self._due_at_stop)  # it is found now
        if self.armed and not armed and now - self._disarm_at > OWN_REQUEST:
            self._take_over(now, zeros=1)  # its kept setpoint must not drive it when armed
            self._disarmed_at = now  # nor where it was taken over
        if mode != self.mode:
            self._zero_in_mode = self._brakes = False
            self._mode_at = now
            asked = mode == self.ways.hold and now - self._hold_at < OWN_REQUEST
            by_us = asked and not self._moved_last  # while driving, we had not requested it
            # in one step: the news of HOLD, a client's request for it, and ours to the rover
            by_us |= self.batches and mode == self.ways.hold and now == self._hold_wished_at
            # it restarted before it was driven: the starting task starts again
            by_us |= mode == INITIALISING and not self._moved_last
            # a person ends what the server only brakes, after an earlier one; no task is taken
            by_us |= mode == self.ways.hold and self._is_met
            if self.mode == self.ways.ours and not by_us:
                self._take_over(now, zeros=0)
        self.armed, self.mode = armed, mode
        if armed and mode == self.ways.ours:
            self._unready_since = None
        elif self._unready_since is None:
            self._unready_since = now

    def _is_known_unready(self, now: float) -> bool:
        return self._unready_since is not None and now - self._unready_since > KNOWN

    def _is_held_for_sticks(self, now: float) -> bool:
        """Return whether a stick caused a HOLD request, with zeros until the rover shows HOLD."""
        return now - self._stick_hold_at <= OWN_REQUEST

    @property
    def _is_held_since_stick(self) -> bool:
        """Whether the rover is in our mode, after a HOLD request because of a stick."""
        return self.mode == self.ways.ours and self._stick_hold_at >= self._sticks_at > -1e9

    def _take_over(self, now: float, *, zeros: int) -> None:
        """Note that another party has the rover; relevant only while the server drives."""
        self._in_row = 0  # it may have been handing back, which ends, too
        if not self._moved_last and now - self._hold_at < OWN_REQUEST:
            return  # it was handing the rover back
        if now - self._setpoint_at < ENGAGED and not self.stopped and not self.taken_over:
            self.taken_over = True
            self._zeros_left = zeros
            self._moved_last = False

    def _see_setpoint(self, now: float, message: Any) -> None:
        values = (message.vx, message.vy, message.vz, message.yaw_rate)
        if not all(isfinite(value) for value in values):
            self._violation(now, f"setpoint not finite: {message}")
        moves = _moves(message)
        if moves and not self.armed:
            self._violation(now, "moving setpoint to a rover not seen armed")
        if (message.get_srcSystem(), message.get_srcComponent()) != SERVER:
            if moves and now - self._setpoint_at < ENGAGED and self._in_row > GREETING:
                self._violation(now, "a client's setpoint while the server drives")
            return
        if self.taken_over and (moves or now != self._greeting_at):
            # a zero accompanies or follows HOLD: for a pause, or to undo a late request
            hold_at = self._hold_at if self.expects_late_modes else -1e9
            is_held = now - max(hold_at, self._stick_hold_at) <= OWN_REQUEST
            is_pause = now == self._pause_at or self._is_held_since_stick
            if moves:
                self._violation(now, "moving setpoint after a takeover")
            elif now == self._disarmed_at or is_held:
                pass
            elif self.mode < 0:
                pass  # a new gateway brakes it, and knows its last heartbeat only
            elif is_pause or self._zeros_left == 0:
                self._hold_due = now
            self._zeros_left = max(0, self._zeros_left - 1)
        self._check_rate(now, moves=moves)
        if moves:
            self._check_motion(now)
            self._is_met = False
        else:
            if self._moved_last or now - self._setpoint_at > GAP:
                self._zeros_since = now
            self._zero_in_mode = True
            if self._stop_due is not None:
                self._stop_due[1].discard("zero")
        # before it is armed, zeros stand in for the setpoints of a client that may drive it
        self._in_row = self._in_row * self.armed + 1 if now - self._setpoint_at <= GAP else 1
        self._setpoint_at = now
        self._brakes = not moves and (self._moved_last or self._brakes)
        self._moved_last = moves

    def _check_motion(self, now: float) -> None:
        if self.mode != self.ways.ours:
            self._violation(now, f"moving setpoint in mode {self.mode}")
        elif not self._zero_in_mode:
            self._violation(now, "moving setpoint before a zero in this mode")
        if now - min(self._position_at, self._attitude_at) > FRESH:
            self._violation(now, "moving setpoint on stale data")
        if now - min(self._position_sent_at, self._attitude_sent_at) > SENT:
            self._violation(now, "moving setpoint on data that were sent too long ago")

    def _check_rate(self, now: float, *, moves: bool) -> None:
        gap = now - self._setpoint_at if self._moved_last else 0.0
        if gap > self.longest_gap and moves:
            self._violation(now, f"gap of {gap:.3f} s, then motion")
        elif gap > GAP and not self.expects_gaps:
            self._violation(now, f"gap of {gap:.3f} s while driving")
        if moves:
            if len(self._recent) == BURST and now - self._recent[0] < 0.1:
                self._violation(now, "burst of setpoints")
            self._recent.append(now)

    def _see_command(self, now: float, message: Any) -> None:
        if (message.get_srcSystem(), message.get_srcComponent()) != SERVER:
            if self._is_wish_for_our_mode(message) and not self._moved_last:
                self._in_row = 0  # it was handing the rover back, and that client has it now
            return
        if message.command == ARM:
            if message.param1 == 0.0:
                self._disarm_at = now
            elif self.ways.arms_in_hold and self.mode != self.ways.hold:
                self._violation(now, f"arming in mode {self.mode}")
            elif not self.ways.arms_in_hold and (
                self.mode != self.ways.ours or not self._zero_in_mode
            ):
                self._violation(now, f"arming in mode {self.mode}, before a zero in our mode")
            elif self.taken_over:
                self._violation(now, "arming after a takeover")
        elif message.command == SET_MODE:
            self._see_mode_asked(now, self.ways.mode_of(message))

    def _see_mode_asked(self, now: float, wanted: int) -> None:
        ways = self.ways
        if wanted == ways.hold:
            self._hold_at, self._is_met = now, False
            is_for_stick = self._is_held_for_sticks(now) or self._is_held_since_stick
            if now == self._sticks_at or is_for_stick:
                self._stick_hold_at = now
            if now == self._pause_at:  # carried out as HOLD, it is a request for HOLD
                self._see_wish_of_client(now, wanted)
            self._hold_due = None
            if self._stop_due is not None:
                self._stop_due[1].discard("HOLD")
        elif self.taken_over:
            self._violation(now, "our mode asked for after a takeover")
        elif ways.arms_in_hold:
            if not self.armed or self.mode not in (ways.hold, ways.ours):
                self._violation(now, f"our mode taken from mode {self.mode}, armed={self.armed}")
            elif now - self._zeros_since < LEAD_IN or now - self._setpoint_at > GAP:
                self._violation(now, "our mode asked for before a second of zeros")
        elif self.batches and now == self._mode_at:
            pass  # it left in the step of the news, and perhaps before it
        elif self.mode not in (ways.hold, ways.ours) and (
            (self.armed and now - self._client_arms_at > BY_CLIENT) or self.mode not in ways.manual
        ):
            self._violation(now, f"our mode taken from mode {self.mode}")

    def _check_stopped(self, now: float, message: Any) -> None:
        """Check that nothing that could move the rover passes while STOP is latched."""
        kind = message.get_type()
        moves = (kind in SETPOINTS and _moves(message)) or kind in (*MOTION[2:], *BY_HAND)
        if kind in COMMANDS:
            moves = (
                (message.command == ARM and message.param1 != 0.0)
                or (message.command == SET_MODE and self.ways.mode_of(message) != self.ways.hold)
                or (message.command in MOVING_COMMANDS and not _is_to_stay(message))
            )
        elif kind == "SET_MODE":
            moves = message.custom_mode != self.ways.hold
        if moves:
            self._violation(now, f"passed in spite of STOP: {self._name(message)}")

    def _keeps_moving(self, message: Any) -> float:
        """Return how long the rover may move after a packet if nothing follows, s."""
        kind, never = message.get_type(), -1e9
        quiet = (self.ways.ours, self.ways.hold)  # modes in which it waits
        if kind in SETPOINTS:
            return ROVER_TIMEOUT if _moves(message) else never
        if kind == "SET_MODE":
            return never if message.custom_mode in quiet else FAR
        if kind not in COMMANDS:
            return FAR if kind in (*MOTION[2:], *BY_HAND) else never
        if message.command == SET_MODE:
            return never if self.ways.mode_of(message) in quiet else FAR
        goes = message.command in MOVING_COMMANDS and not _is_to_stay(message)
        return FAR if goes else never

    def _turns(self, now: float, message: Any) -> bool:
        """Return whether a zero-speed setpoint turns the rover: a PX4 faces along its course."""
        if _moves(message) or not (message.vx or message.vy):
            return False
        course = atan2(message.vy, message.vx)
        if self._course is not None and abs(remainder(course - self._course, tau)) > ANOTHER_COURSE:
            self._course_at = now
        self._course = course
        return now - self._course_at <= TURN

    def _check_stop(self, now: float) -> None:
        """Check that zero and HOLD left in the step of a STOP, or HOLD in that of a pause."""
        if self._hold_due is not None and now > self._hold_due:
            self._violation(self._hold_due, "setpoint after a takeover: zero without HOLD")
            self._hold_due = None
        if self._stop_due is not None and now > self._stop_due[0]:
            at, missing = self._stop_due
            self._stop_due = None
            if missing:
                self._violation(at, f"STOP without {' and '.join(sorted(missing))} at once")

    def _is_for_another(self, message: Any) -> bool:
        target = getattr(message, "target_system", getattr(message, "target", 0))
        return target not in (0, self.system_id)

    def _decode(self, data: bytes) -> Any:
        if len(data) < 12 or data[0] != 0xFD or data[7] not in WATCHED or data[8] or data[9]:
            return None
        try:
            return self._decoder.decode(bytearray(data))
        except common.MAVError:
            return None  # garbage that a test sends

    def _name(self, message: Any) -> str:
        """Return one word for a packet to the rover."""
        kind = message.get_type()
        if kind in SETPOINTS:
            return "move" if _moves(message) else "zero"
        if kind not in COMMANDS:
            return str(kind)
        if message.command == SET_MODE:
            mode = self.ways.mode_of(message)
            return {self.ways.hold: "HOLD", self.ways.ours: "GUIDED"}.get(mode, f"mode{mode}")
        if message.command == ARM:
            return "arm" if message.param1 else "disarm"
        if message.command == REQUEST and not message.param1:
            return SHOW
        return "stay" if _is_to_stay(message) else str(message.command)

    def _violation(self, now: float, text: str) -> None:
        self.violations.append(f"{now:.3f}: {text}")


def _moves(message: Any) -> bool:
    """Return whether a setpoint demands motion; 1 mm/s along a course makes a PX4 rover stand."""
    speeds = (message.vx, message.vy, message.vz, message.yaw_rate)
    return any(not abs(speed) < 0.002 for speed in speeds)


def _off_centre(message: Any, throttles: tuple[int, ...]) -> bool:
    if message.get_type() == "MANUAL_CONTROL":
        throttle = min((message.z - centre for centre in throttles), key=abs)
        axes = (message.x, message.y, throttle, message.r)
        return any(abs(a) > STICKS for a in axes if a != 0x7FFF)
    channels = (message.chan1_raw, message.chan2_raw, message.chan3_raw, message.chan4_raw)
    return any(abs(c - 1500) > STICKS for c in channels if c not in (0, 65535))


def _is_to_stay(message: Any) -> bool:
    """Return whether it is a "go to" without a place."""
    return (
        message.command == REPOSITION
        and message.get_type() == "COMMAND_INT"
        and (message.x, message.y) == (NO_PLACE, NO_PLACE)
    )
