"""Missions uploaded by MAVSDK to the server and to MAVSDK's own mission server, by turns."""

import signal
from collections import defaultdict
from collections.abc import Iterator
from contextlib import ExitStack
from math import nan
from pathlib import Path
from statistics import median
from time import perf_counter, sleep
from typing import Any

from mavsdk import ComponentType, Configuration, Mavsdk, log_subscribe
from mavsdk.plugins.mission_raw import MissionRaw
from mavsdk.plugins.mission_raw.mission_raw import MissionItem
from mavsdk.plugins.mission_raw_server import MissionRawServer

from tests.kit.processes import free_udp_ports

from .processes import HOST, beside, server, simulated_rovers
from .rows import Row

SIZES = (50, 500)  # items
UPLOADS, WARM_UP = 20, 3
#: s before each upload. Within 0.6 s of the previous upload, the server waits for late items
#: (engine/missions/transfer.py); the upload to the other end is in between
BETWEEN = 0.35
FIND_WITHIN = 10.0  # s
LATITUDE, LONGITUDE = -353632621, 1491652374  # degE7, the simulated rover's start
METRE = 90  # degE7 of latitude, about
WAYPOINT: dict[str, Any] = {"frame": 6, "command": 16, "autocontinue": 1, "mission_type": 0}
WAYPOINT |= {"param1": 0.0, "param2": 1.0, "param3": 0.0, "param4": nan, "z": 0.0}


def measure(tree: Path) -> Iterator[Row]:
    """Uploads by MAVSDK → durable acknowledgement; beside MAVSDK's server, which keeps no file.

    Both figures include the client's own cost.
    """
    log_subscribe(lambda *_: True)  # it logs to our output
    (port,) = free_udp_ports(1)
    with (
        beside(_vehicle, port),
        simulated_rovers(1) as rover,
        server(tree, rover, "--store=tasks.sqlite3") as it,
        ExitStack() as stack,
    ):
        it.wait_for("rover 1: found")
        ends = [_connected(each, stack) for each in (it.port, port)]
        times: dict[tuple[int, int], list[float]] = defaultdict(list)
        for number in range(WARM_UP + UPLOADS):
            for count in SIZES:
                items = _items(count, number)
                for at, end in enumerate(ends):
                    sleep(BETWEEN)
                    begin = perf_counter()
                    end.upload_mission(items)  # raises unless accepted
                    times[count, at].append(perf_counter() - begin)
        as_sent = [MissionItem.from_c_struct(item.to_c_struct()) for item in items]  # float32
        for end in ends:
            assert list(map(str, end.download_mission())) == list(map(str, as_sent))
    for count in SIZES:
        ours, theirs = (median(times[count, at][WARM_UP:]) for at in (0, 1))
        what = f"upload of {count} items → durable ack, p50"
        yield Row(what, ours, "ms", theirs, "MAVSDK's server", "≤ 2×")


def _vehicle(port: int) -> None:
    configuration = Configuration.create_with_component_type(ComponentType.AUTOPILOT)
    with Mavsdk(configuration) as mavsdk:
        mavsdk.add_any_connection(f"udpin://{HOST}:{port}")
        server = MissionRawServer(mavsdk.server_component())
        signal.pause()
        server.destroy()


def _connected(port: int, stack: ExitStack) -> Any:
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    mavsdk = stack.enter_context(Mavsdk(configuration))
    mavsdk.add_any_connection(f"udpout://{HOST}:{port}")
    return MissionRaw(mavsdk.first_autopilot(FIND_WITHIN))


def _items(count: int, number: int) -> list[Any]:
    """Return a line of waypoints, a metre apart; items of different numbers are all different."""
    y = LONGITUDE + METRE * number
    return [
        MissionItem(seq=seq, current=int(seq == 0), x=LATITUDE + METRE * seq, y=y, **WAYPOINT)
        for seq in range(count)
    ]
