"""An engine that receives packets of every kind, and checks on its reactions.

Bytes without a valid packet change nothing but counters. A valid packet may request anything, but
never makes the engine send nonsense to a rover.
"""

import gc
from collections import Counter
from collections.abc import Callable, Hashable
from dataclasses import replace
from math import isfinite
from random import Random

from pymavlink.dialects.v20 import common

from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import (
    Committed,
    KeysChanged,
    LinkChanged,
    LinkSide,
    Outgoing,
    Packets,
    PeerChanged,
    WallClock,
)
from mav_tasks.engine.snapshot import Snapshot
from mav_tasks.mavlink.signing import Key, timestamp_at
from mav_tasks.settings import Clients, Queueing, Settings
from mav_tasks.tasks.server_events import SignaturesSeen
from tests.kit.bounds import Violation, entries, too_large
from tests.kit.client import command_long
from tests.kit.packets.mutants import Mutant, Mutants, Sign, badly_signed
from tests.kit.packets.whole import LONGEST, has_whole_packet

CLIENTS, CALLERS, ROVERS, LINES = "clients", "callers", "rovers", "lines"
STREAMS = (CALLERS, LINES)
ENDS = (
    *((CLIENTS, "station"), (CLIENTS, "station"), (CALLERS, "caller"), (CALLERS, "other caller")),
    *((ROVERS, "rover1"), (ROVERS, "rover1"), (LINES, "rover2")),
)
OF_PEER: dict[Hashable, int] = {"rover1": 1, "rover2": 2}
UTC = 1.8e9  # s, start time if signatures are checked
STATION = 1  # link id
STRANGERS = 1_000
MOST_CLIENTS = 16
BURST = 50  # packets at one time
STEP = 0.02  # s, between two bursts
BEAT = 0.5  # s, between two rounds of telemetry and station packets
WALK = 10_000  # packets, between two size checks of the engine's memory
SETPOINTS = (82, 84, 86)


class Battered:
    """An engine with two rovers and three clients, on datagram and stream links."""

    def __init__(
        self,
        seed: int,
        *,
        sign: Sign = badly_signed,
        is_valid: Callable[[str, bytes], bool] = lambda _link, data: has_whole_packet(data),
        key: Key | None = None,
    ) -> None:
        """``is_valid`` returns whether a link's bytes may change anything.

        With a ``key``, clients must sign with it, as the station does.
        """
        self.seed = seed
        self.now = 0.0
        self.counts: Counter[str] = Counter()
        self.index = 0
        settings = Settings(
            queueing=Queueing(capacity=20, quota=20),
            clients=Clients(max_clients=MOST_CLIENTS, packet_rate=1e9),  # no packet is dropped
        )
        self.engine = Engine(settings, now=0.0)
        self._random = Random(seed)
        self._mutants = Mutants(self._random, sign=sign)
        self._is_valid = is_valid
        self._durable = 0
        self._tails: dict[tuple[str, Hashable], bytes] = {}
        self._beat_at = 0.0
        self._numbers = 0
        self._decoder = common.MAVLink(None)
        self._station = common.MAVLink(None, 255, 190)
        if key is not None:
            signing = self._station.signing
            signing.secret_key, signing.link_id, signing.sign_outgoing = key.secret, STATION, True
            signing.timestamp = timestamp_at(UTC)
            self.engine.handle(WallClock(UTC), now=0.0)
            self.engine.handle(KeysChanged((key,)), now=0.0)
        for link, side in (
            *((CLIENTS, LinkSide.CLIENTS), (CALLERS, LinkSide.CLIENTS)),
            *((ROVERS, LinkSide.VEHICLES), (LINES, LinkSide.VEHICLES)),
        ):
            change = LinkChanged(
                link,
                side,
                up=True,
                is_stream=link in STREAMS,
                takes_unsigned=key is None or side is LinkSide.VEHICLES,
            )
            self.engine.handle(change, now=0.0)
        for link, peer in ENDS:
            if link in STREAMS:
                self.engine.handle(PeerChanged(link, peer, up=True), now=0.0)
        self._before: Snapshot | None = None  # None: a valid packet came after the last snapshot
        self._live()

    def run(self, count: int) -> None:
        """Send ``count`` packets to the engine. Raise Violation for a wrong reaction."""
        for _ in range(count):
            self._take(self._mutants.any())
        gc.collect()
        self._raise_if_too_large()

    def entries(self) -> int:
        """Return the total number of entries in all containers, except those for tasks."""
        return entries(self.engine)

    def _take(self, mutant: Mutant) -> None:
        if self.index % BURST == 0:
            self._pass_time()
        self.index += 1
        link, peer = self._end()
        data = mutant.data
        self.counts[mutant.how] += 1
        key = link, peer
        if link in STREAMS:
            data = self._tails.get(key, b"") + data
            self._tails[key] = data[-LONGEST:]
        must_do_nothing = not self._is_valid(link, data)
        if must_do_nothing and self._before is None:
            self._before = self._state()
        try:
            self.engine.handle(Packets(link, [(peer, mutant.data)]), now=self.now)
            has_events = self._turn()
        except Violation:
            raise
        except Exception as error:
            raise self._violation(mutant, f"{type(error).__name__}") from error
        if not must_do_nothing:
            self._before = None
        elif has_events or self._state() != self._before:
            raise self._violation(mutant, "it is no packet, and has changed something")
        if self.index % WALK == 0:
            self._raise_if_too_large()

    def _end(self) -> tuple[str, Hashable]:
        """Return the source of the next packet, sometimes a new one."""
        if self._random.random() < 0.8:
            return self._random.choice(ENDS)
        return self._random.choice((CLIENTS, ROVERS)), self._random.randrange(STRANGERS)

    def _pass_time(self) -> None:
        self.now += STEP
        due = self.engine.next_deadline()
        if due is not None and due <= self.now:
            self.engine.handle_deadline(now=self.now)
        if self.now >= self._beat_at:
            self._beat_at = self.now + BEAT
            self._live()
        self._turn()
        self._before = None

    def _live(self) -> None:
        """Send telemetry of the rovers, and a new continue of the station."""
        for system in (1, 2):
            self._numbers += 1  # in param7, so that each command is new
            on = command_long(193, 1, 0, 0, 0, 0, 0, self._numbers, target=(system, 191))
            message = Packets(CLIENTS, [("station", on.pack(self._station))])
            self.engine.handle(message, now=self.now)
        for link, peer, system in ((ROVERS, "rover1", 1), (LINES, "rover2", 2)):
            mav = common.MAVLink(None, system, 1)
            packets = [
                message.pack(mav)
                for message in (
                    common.MAVLink_heartbeat_message(10, 3, 129, 15, 4, 3),
                    common.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0),
                    common.MAVLink_local_position_ned_message(1, 0, 0, 0, 0, 0, 0),
                )
            ]
            self._tails.pop((link, peer), None)
            self.engine.handle(
                Packets(link, [(peer, bytes(LONGEST)), *((peer, each) for each in packets)]),
                now=self.now,
            )
        self._turn()

    def _turn(self) -> bool:
        """Check the packets that go out, and commit all events; return whether there were any."""
        has_events = False
        while True:
            packets, events = self.engine.take_packets(), self.engine.take_events()
            for outgoing in packets:
                if outgoing.link in (ROVERS, LINES):
                    self._look_at(outgoing)
            if not events:
                return has_events
            has_events |= any(not isinstance(event, SignaturesSeen) for event in events)
            self._durable += len(events)
            self.engine.handle(Committed(self._durable), now=self.now)

    def _look_at(self, outgoing: Outgoing) -> None:
        data = outgoing.data
        if data[0] != 0xFD or data[7] not in SETPOINTS or data[8] or data[9]:
            return
        try:
            message = self._decoder.decode(bytearray(data))
        except common.MAVError:
            return  # forwarded unchanged; the rover detects the damage, too
        if data[7] == SETPOINTS[0]:
            values = [message.thrust, message.body_yaw_rate]
        else:
            values = [message.vx, message.vy, message.vz, message.yaw_rate]
        if not all(map(isfinite, values)):
            raise Violation(f"seed {self.seed}, packet {self.index}: not finite: {message}")
        system = message.target_system or OF_PEER.get(outgoing.peer, 0)
        seen = self.engine.snapshot(now=self.now).vehicles
        if any(values) and system and not any(v.armed for v in seen if v.system_id == system):
            raise Violation(f"seed {self.seed}, packet {self.index}: to one not armed: {message}")

    def _state(self) -> Snapshot:
        return replace(self.engine.snapshot(now=self.now), decoded="")

    def _raise_if_too_large(self) -> None:
        for text in too_large(self.engine):
            raise Violation(f"seed {self.seed}, packet {self.index}: {text}")

    def _violation(self, mutant: Mutant, text: str) -> Violation:
        where = f"seed {self.seed}, packet {self.index} ({mutant.how})"
        return Violation(f"{where}: {text}: {mutant.data.hex()}")
