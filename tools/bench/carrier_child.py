"""``python -m tools.bench.carrier_child URL NAME OTHERS …``: one gateway's mail, for ``carrier``.

It says "ready" when it has met all the others. After a line on its standard input it sends to each
of them for some seconds, and prints what has come, as JSON. It ends with its standard input. The
payloads have the time of sending: all gateways are on one machine.
"""

import json
import select
import struct
import sys
from dataclasses import asdict, dataclass, field
from itertools import cycle

from mav_tasks.basics.clock import boot_time
from mav_tasks.fleet.exchange import Arrived
from mav_tasks.fleet.io.carrier import Carrier
from mav_tasks.store.postgres.address import parse
from mav_tasks.store.postgres.session import Session

from .carrier_result import Result, cpu_seconds

SIZE = 60  # bytes, as an average MAVLink packet
STOP_EVERY = 0.05  # s
AFTER = 0.3  # s in which the last ones arrive
_STAMP = struct.Struct(">d?")


@dataclass
class _Load:
    """What is sent: one ordinary datagram a turn, to the others by turns; and STOPs to all."""

    carrier: Carrier
    others: tuple[str, ...]
    rate: float  # /s, to each of them; 0: STOPs only
    result: Result = field(default_factory=Result)

    def run(self, seconds: float) -> None:
        """Send, and receive."""
        now = boot_time()
        end = now + seconds
        step = 1 / (self.rate * len(self.others)) if self.rate else seconds
        next_one, next_stop = now, now
        whom = cycle(self.others)
        while (now := boot_time()) < end:
            while self.rate and next_one <= now:
                self.carrier.send(next(whom), _payload(False))
                self.result.sent += 1
                next_one += step
            if next_stop <= now:
                self.carrier.send("", _payload(True), first=True)
                next_stop += STOP_EVERY
            due = min(next_stop, next_one if self.rate else end)
            self._receive(max(0.0, min(due, end) - boot_time()))
        while boot_time() < end + AFTER:
            self._receive(AFTER)

    def _receive(self, within: float) -> None:
        fd = self.carrier.fileno()
        assert fd is not None, "it is open"
        select.select([fd], [], [], within)
        now = boot_time()
        for each in self.carrier.take():
            if isinstance(each, Arrived):
                sent_at, is_stop = _STAMP.unpack_from(each.payload)
                (self.result.stops if is_stop else self.result.ordinary).append(now - sent_at)
                self.result.over.append(each.waited - (each.at - sent_at))
            else:
                raise SystemExit(f"the database: {each.words}")


def _payload(is_stop: bool) -> bytes:
    return _STAMP.pack(boot_time(), is_stop).ljust(SIZE, b"\0")


def _durable(carrier: Carrier, session: Session) -> None:
    """Let each sending wait for the disk, for comparison."""
    _listen(carrier, session)
    session.execute("SELECT set_config('synchronous_commit', 'on', false)")


_listen = Carrier._listen


def main() -> None:
    """Run one gateway."""
    url, name, others, rate, seconds, commit = sys.argv[1:]
    if commit == "on":
        setattr(Carrier, "_listen", _durable)  # noqa: B010  # no class of its own for a comparison
    carrier = Carrier(parse(url), name)
    load = _Load(carrier, tuple(others.split(",")), float(rate))
    while not carrier.peers >= set(load.others):
        load._receive(0.01)
    print("ready", flush=True)
    sys.stdin.readline()
    before = cpu_seconds("self")
    load.run(float(seconds))
    load.result.cpu = cpu_seconds("self") - before
    print(json.dumps(asdict(load.result)), flush=True)
    sys.stdin.read()
    carrier.close()


if __name__ == "__main__":
    main()
