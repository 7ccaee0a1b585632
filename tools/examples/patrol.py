"""Drive a square, round after round, and say what each side took. Ctrl-C cancels what is left.

Usage: python patrol.py [URL of the task server] [rounds] [side in metres]
"""

import asyncio
import sys
from math import radians

from mav_tasks import Client, Move, Rotate, Task, TaskFailed


async def patrol(url: str, rounds: int, side: float) -> None:
    async with Client(url) as tasks:
        for number in range(1, rounds + 1):
            sides: list[Task] = []
            try:
                for corner in range(1, 5):
                    label = f"round {number} side {corner}"
                    # Each side waits for the one before: if that fails, the rest does not run.
                    before = sides[-1] if sides else 0
                    goals = (Move(side), Rotate(radians(90)))
                    sides.append(await tasks.submit(goals, after=before, label=label))
                for task in sides:
                    done = await task.done()
                    print(f"{done.label}: {done.execution_time:.1f} s")
            except TaskFailed as why:
                print(f"round {number} ended: {why}")
                return
            except asyncio.CancelledError:
                await tasks.clear(running_too=True)
                raise


if __name__ == "__main__":
    given = sys.argv[1:] + ["udpout:127.0.0.1:14560", "1", "1.0"][len(sys.argv) - 1 :]
    asyncio.run(patrol(given[0], int(given[1]), float(given[2])))
