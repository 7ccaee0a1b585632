"""What strangers cost one engine in this process: memory that stays, and CPU time of each packet.

It runs with the modules of any revision on its path, as ``turn_child`` does:
``PYTHONPATH=TREE python -P tools/bench/strangers_child.py WHAT ENDPOINTS ADDRESSES PACKETS``, WHAT
being ``bytes`` or ``seconds`` (of a packet). Each address at each endpoint sends so many commands,
no two alike, within the rate of its role: "continue", which it may not send, and requests.
"""

import gc
import sys
import tracemalloc
from time import process_time_ns

from mav_tasks.config.settings import Clients, Roles, Settings
from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import LinkChanged, LinkSide, Packets
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder

CLIENTS, VEHICLES, ROVER = "clients", "vehicles", "rover"
CONTINUE, REQUEST = 193, 512
RATE = 100.0  # packets a second from one endpoint


def main() -> None:
    """Print the cost of strangers."""
    endpoints, addresses, packets = map(int, sys.argv[2:])
    if sys.argv[1] == "bytes":
        tracemalloc.start()
    settings = Settings(clients=Clients(packet_rate=1e6), roles=Roles(unsigned="observer"))
    engine = Engine(settings, now=0.0)
    rover = Encoder(Address(1, 1))
    engine.handle(LinkChanged(VEHICLES, LinkSide.VEHICLES, True, (ROVER,)), now=0.0)
    engine.handle(LinkChanged(CLIENTS, LinkSide.CLIENTS, True), now=0.0)
    strangers = [
        (("10.0.0.1", port), Encoder(Address(1 + number, 190)))
        for number in range(addresses)
        for port in range(1, 1 + endpoints)
    ]
    now, before, spent, count = 0.0, 0, 0, 0
    for turn in range(-1, packets):  # in the first they only come
        for number, (peer, encoder) in enumerate(strangers):
            if number % endpoints == 0:
                now += 1 / RATE
                beat = rover.encode(m.Heartbeat(10, 3, 1, 4, 3, 3))
                engine.handle(Packets(VEHICLES, [(ROVER, beat)]), now=now)
                engine.handle_deadline(now=now)
                engine.take_packets()
                engine.take_events()
            message: m.Message = m.Heartbeat(6, 8, 0, 0, 4, 3)
            if turn >= 0:
                command = CONTINUE if turn % 5 else REQUEST
                message = m.CommandLong(1, 191, command, 0, 1, 0, 0, 0, turn, number, 0)
            data = encoder.encode(message)
            began = process_time_ns()
            engine.handle(Packets(CLIENTS, [(peer, data)]), now=now)
            spent += process_time_ns() - began
            count += 1
            engine.take_packets()
            engine.take_events()
        if turn < 0:
            before, spent, count = _allocated(), 0, 0
    print(_allocated() - before if sys.argv[1] == "bytes" else spent / count * 1e-9)


def _allocated() -> int:
    gc.collect()
    return tracemalloc.get_traced_memory()[0]


if __name__ == "__main__":
    main()
