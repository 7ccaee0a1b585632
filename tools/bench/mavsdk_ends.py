"""MAVSDK's own ends of an upload, each in its own process.

``python -m tools.bench.mavsdk_ends vehicle PORT`` is an autopilot that receives missions and keeps
them in memory. ``… client URL URL`` uploads to both in turn, and prints the seconds of each upload
as JSON: by URL, by number of items.
"""

import json
import signal
import sys
from contextlib import ExitStack
from math import nan
from time import perf_counter, sleep
from typing import Any

from mavsdk import ComponentType, Configuration, Mavsdk, log_subscribe
from mavsdk.plugins.mission_raw import MissionRaw
from mavsdk.plugins.mission_raw.mission_raw import MissionItem
from mavsdk.plugins.mission_raw_server import MissionRawServer

from .child import HOST, READY

SIZES = (50, 500)  # items
REPEATS = 30
WARM_UP = 3
#: s before each upload. Within 0.6 s of the previous upload, the server waits for late items
#: (engine/missions/transfer.py); the upload to the other end is in between
BETWEEN = 0.35
FIND_WITHIN = 10.0  # s
LATITUDE, LONGITUDE = -353632621, 1491652374  # degE7, the simulated rover's start
METRE = 90  # degE7 of latitude, about
WAYPOINT = 16
GLOBAL_RELATIVE_ALT_INT = 6


def _take_in(port: int) -> None:
    """Run an autopilot until SIGTERM."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
    with Mavsdk(Configuration.create_with_component_type(ComponentType.AUTOPILOT)) as mavsdk:
        mavsdk.add_any_connection(f"udpin://{HOST}:{port}")
        server = MissionRawServer(mavsdk.server_component())
        print(READY, flush=True)
        signal.sigwait({signal.SIGTERM})
        server.destroy()


def _upload(urls: list[str]) -> None:
    times: dict[str, dict[int, list[float]]] = {url: {n: [] for n in SIZES} for url in urls}
    with ExitStack() as stack:
        ends = {url: _connect(url, stack) for url in urls}
        for number in range(WARM_UP + REPEATS):
            for count in SIZES:
                items = _items(count, number)
                for url, end in ends.items():
                    sleep(BETWEEN)
                    start = perf_counter()
                    end.upload_mission(items)  # raises unless accepted
                    times[url][count].append(perf_counter() - start)
        for count in SIZES:
            items = _items(count, number + 1)
            for url, end in ends.items():
                end.upload_mission(items)
                _compare(url, end.download_mission(), items)
    print(
        json.dumps({url: {n: t[WARM_UP:] for n, t in each.items()} for url, each in times.items()})
    )


def _connect(url: str, stack: ExitStack) -> Any:
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    mavsdk = stack.enter_context(Mavsdk(configuration))
    mavsdk.add_any_connection(url)
    system = mavsdk.first_autopilot(FIND_WITHIN)
    if system is None:
        raise RuntimeError(f"{url}: no autopilot")
    return MissionRaw(system)


def _items(count: int, number: int) -> list[Any]:
    """Return a line of waypoints, a metre apart; items of different numbers are all different."""
    return [
        MissionItem(
            seq=seq,
            frame=GLOBAL_RELATIVE_ALT_INT,
            command=WAYPOINT,
            current=int(seq == 0),
            autocontinue=1,
            param1=0.0,
            param2=1.0,
            param3=0.0,
            param4=nan,
            x=LATITUDE + METRE * seq,
            y=LONGITUDE + METRE * number,
            z=0.0,
            mission_type=0,
        )
        for seq in range(count)
    ]


def _compare(url: str, came: list[Any], sent: list[Any]) -> None:
    if list(map(str, came)) != list(map(str, map(_as_came, sent))):
        raise RuntimeError(f"{url}: what was downloaded is not what was uploaded")


def _as_came(item: Any) -> Any:
    """Return an item with the library's values: float32, as on the wire."""
    return MissionItem.from_c_struct(item.to_c_struct())


def main(kind: str, *arguments: str) -> None:
    """Run one of the two ends."""
    log_subscribe(lambda *_: True)  # its log would mix with our output
    if kind == "vehicle":
        _take_in(int(arguments[0]))
    else:
        _upload(list(arguments))


if __name__ == "__main__":
    main(*sys.argv[1:])
