"""A real server on loopback with room for every task of a measurement, and no rate limits.

``python -m tools.bench.server CLIENT_PORT VEHICLE_PORT [--store FILE] [--profile FILE] [--drive]
[--tlog FOLDER] [--record FOLDER] [--metrics HOST:PORT] [--times] [--default-limits]``. Without
``--default-limits``, clients may send any amount. ``--profile`` writes cProfile's figures of the
whole run to a file. With ``--drive`` the server arms and drives; otherwise no task starts. At its
end it prints as JSON the deviation from 1/20 s, in seconds, of each interval between two moving
setpoints to one vehicle; with ``--times`` pairs of that and the monotonic time when the interval
ended. The zero that ends a drive leaves at once and is not counted.
"""

import argparse
import asyncio
import cProfile
import json
import sys
import time
from pathlib import Path

from mav_tasks.basics.clock import boot_time
from mav_tasks.config.configuration import Sources
from mav_tasks.config.key_ring.watch import RingWatch
from mav_tasks.config.reload import Reload
from mav_tasks.config.settings import Clients, Limits, Log, Queueing, Recording, Roles, Settings
from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import Peer
from mav_tasks.links.udp import UdpLink, UdpUrl
from mav_tasks.mavlink import messages as m
from mav_tasks.recording import observers
from mav_tasks.shell.logs.setup import log_to_stderr
from mav_tasks.shell.runner import Runner
from mav_tasks.shell.serve import tame_collector
from mav_tasks.store.opening import IN_MEMORY, open_store

from .child import HOST, READY

PERIOD = 0.05  # s between setpoints
SETPOINT = m.SetPositionTargetLocalNed.id
FORWARD = slice(10 + 16, 10 + 20)  # offset of vx, and of target_system,
TARGET_SYSTEM = 10 + 50  # in a whole MAVLink 2 SET_POSITION_TARGET_LOCAL_NED
MOVING = 2 * PERIOD  # s; after a longer interval the stream had ended


class TimedLink(UdpLink):
    """A vehicle link that measures the intervals of setpoints."""

    def __init__(self, url: UdpUrl) -> None:
        super().__init__(url)
        self._last: dict[int, float] = {}
        self.errors: list[float] = []
        self.ended_at: list[float] = []

    def send(self, peer: Peer, data: bytes) -> None:
        """Send, and record the time of a setpoint."""
        super().send(peer, data)
        if data[7] != SETPOINT or data[8] != 0 or len(data) <= TARGET_SYSTEM:
            return
        if not any(data[FORWARD]):
            self._last.pop(data[TARGET_SYSTEM], None)
        else:
            now = time.monotonic()
            interval = now - self._last.get(data[TARGET_SYSTEM], -1.0)
            self._last[data[TARGET_SYSTEM]] = now
            if interval < MOVING:
                self.errors.append(abs(interval - PERIOD))
                self.ended_at.append(now)


def _settings(*, drives: bool, is_limited: bool) -> Settings:
    unlimited = Limits(quota=10_000_000, rate=1e9)
    return Settings(
        queueing=Queueing(capacity=10_000_000, quota=10_000_000),
        clients=Clients() if is_limited else Clients(stream_interval=0.0, packet_rate=1e9),
        roles=Roles() if is_limited else Roles(safety=unlimited),
        arming="server" if drives else "operator",
    )


async def _serve(options: argparse.Namespace, vehicle_link: TimedLink) -> int:
    store = open_store(options.store or IN_MEMORY)
    now = boot_time()
    settings = _settings(drives=options.drive, is_limited=options.default_limits)
    engine = Engine(settings, now=now)
    recording = Recording(tlog=options.tlog, decisions=options.record)
    recorders = observers(recording, settings, None, now=now)
    tame_collector()
    clients = [UdpLink(UdpUrl("udpin", HOST, options.client_port))]
    if options.metrics:
        from mav_tasks.metrics.endpoint import Endpoint  # noqa: PLC0415  # an earlier one lacks it

        recorders.append(
            Endpoint(options.metrics).show(
                engine.figures,
                clients=clients,
                vehicles=[vehicle_link],
                recorders=recorders,
                restored=None,
                version="",
                woke_at=lambda: runner.woke_at,
            )
        )
    print(READY, flush=True)
    sources = Sources("", {})
    runner = Runner(
        engine,
        store,
        clients=clients,
        vehicles=[vehicle_link],
        reload=Reload(sources, sources.load()),
        keys=RingWatch(Path("no ring"), None),
        observers=recorders,
    )
    return await runner.run()


def main() -> int:
    """Serve until a signal."""
    parser = argparse.ArgumentParser()
    parser.add_argument("client_port", type=int)
    parser.add_argument("vehicle_port", type=int)
    parser.add_argument("--store")
    parser.add_argument("--tlog", default="")
    parser.add_argument("--record", default="")
    parser.add_argument("--metrics", default="")
    parser.add_argument("--times", action="store_true")
    parser.add_argument("--profile")
    parser.add_argument("--drive", action="store_true")
    parser.add_argument("--default-limits", action="store_true")
    options = parser.parse_args()
    link = TimedLink(UdpUrl("udpout", HOST, options.vehicle_port))
    with log_to_stderr(Log()):
        if options.profile is None:
            code = asyncio.run(_serve(options, link))
        else:
            profiler = cProfile.Profile()
            code = profiler.runcall(asyncio.run, _serve(options, link))
            profiler.dump_stats(options.profile)
    pairs = list(zip(link.errors, link.ended_at, strict=True))
    print(json.dumps(pairs if options.times else link.errors), flush=True)
    return code


if __name__ == "__main__":
    sys.exit(main())
