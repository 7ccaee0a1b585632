"""A real server on loopback with room for every task of a measurement, and no thinning.

``python -m tools.bench.server CLIENT_PORT VEHICLE_PORT [PROFILE]``; with PROFILE, cProfile's
figures of the whole run are written to that file.
"""

import asyncio
import cProfile
import logging
import sys

from mav_tasks.engine.engine import Engine
from mav_tasks.links.udp import UdpLink
from mav_tasks.links.url import LinkUrl
from mav_tasks.runner import Runner
from mav_tasks.settings import Clients, Queueing, Settings
from mav_tasks.store import MemoryStore

from .child import HOST, READY

#: no task of a measurement is ever begun: the scripted vehicle stays disarmed
SETTINGS = Settings(
    queueing=Queueing(capacity=10_000_000, quota=10_000_000),
    clients=Clients(stream_interval=0.0),
    arming="operator",
)


async def _serve(client_port: int, vehicle_port: int) -> int:
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s")
    engine = Engine(SETTINGS, now=asyncio.get_running_loop().time())
    clients = [UdpLink(LinkUrl("udpin", HOST, client_port))]
    vehicles = [UdpLink(LinkUrl("udpout", HOST, vehicle_port))]
    print(READY, flush=True)
    return await Runner(engine, MemoryStore(), clients=clients, vehicles=vehicles).run()


def _main(client_port: int, vehicle_port: int, profile: str | None) -> int:
    if profile is None:
        return asyncio.run(_serve(client_port, vehicle_port))
    profiler = cProfile.Profile()
    try:
        return profiler.runcall(asyncio.run, _serve(client_port, vehicle_port))
    finally:
        profiler.dump_stats(profile)


if __name__ == "__main__":
    sys.exit(_main(int(sys.argv[1]), int(sys.argv[2]), (*sys.argv[3:], None)[0]))
