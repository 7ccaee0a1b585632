"""The services of the ROS 2 tutorial: add, status, queue, cancel, clear.

Usage: python tutorial_services.py [URL of the task server]
"""

import sys
from math import radians

from mav_tasks import Move, Rotate, SyncClient

url = sys.argv[1] if len(sys.argv) > 1 else "udpout:127.0.0.1:14560"

with SyncClient(url) as tasks:
    # AddTask: task type, priority and parameters in, the id of the task out
    forward = tasks.submit(Move(1.0), priority=3)
    turn = tasks.submit(Rotate(radians(90)), priority=8)
    extra = tasks.submit(Move(0.5), priority=5)
    print("added tasks", forward.id, turn.id, extra.id)

    # GetTaskStatus: the id in; state, type and execution time out
    status = tasks.status(forward.id)
    print(f"task {status.id}: {status.state.name.lower()}: {status.words}")

    # GetQueueStatus: what runs, and what waits, in the order in which it will run
    queue = tasks.queue()
    print("runs:", queue.running, "waits:", [task.id for task in queue.waiting])

    # CancelTask: the id in
    extra.cancel()

    turn.done()
    print(f"task {turn.id} took {tasks.status(turn.id).execution_time:.1f} s")

    # ClearQueue: what waits is cancelled, what runs goes on
    tasks.submit(Move(0.5), delay=3600.0)
    tasks.clear()
    print("after clear:", tasks.queue().waiting_count, "tasks wait")
