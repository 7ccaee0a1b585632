"""Print what rovers and the task server say, and where the rovers are, for some seconds.

Usage: python watch.py [URL of the task server] [seconds]
"""

import asyncio
import sys
from math import degrees

from mav_tasks import Client


async def print_texts(tasks: Client) -> None:
    async for text in tasks.texts():
        who = "server" if text.component == 191 else "rover"
        print(f"rover {text.vehicle}: {who} says: {text.words}", flush=True)


async def print_places(tasks: Client) -> None:
    while True:
        for rover in tasks.vehicles():
            if rover.north is None or rover.east is None or rover.yaw is None:
                place = "no position"
            else:
                heading = degrees(rover.yaw) % 360
                place = f"{rover.north:.1f} m north, {rover.east:.1f} m east, {heading:.0f} deg"
            print(f"rover {rover.id}: {rover.mode}: {place}", flush=True)
        await asyncio.sleep(1.0)


async def watch(url: str, seconds: float) -> None:
    async with Client(url) as tasks:
        work = asyncio.gather(print_texts(tasks), print_places(tasks))
        try:
            await asyncio.wait_for(work, seconds)
        except TimeoutError:
            print("done")


if __name__ == "__main__":
    given = sys.argv[1:] + ["udpout:127.0.0.1:14560", "10"][len(sys.argv) - 1 :]
    asyncio.run(watch(given[0], float(given[1])))
