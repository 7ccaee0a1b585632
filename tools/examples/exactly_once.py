"""Submit a task that is one task, even if this script is killed and started again.

The nonce is written to a file before the task is submitted. A second run submits with the same
nonce, and the server answers with the same task.

Usage: python exactly_once.py [URL of the task server] [file for the nonce]
"""

import secrets
import sys
from pathlib import Path

from mav_tasks import Move, NoAnswer, SyncClient

url = sys.argv[1] if len(sys.argv) > 1 else "udpout:127.0.0.1:14560"
file = Path(sys.argv[2] if len(sys.argv) > 2 else "nonce.txt")

if not file.exists():
    file.write_text(str(secrets.randbelow(1_000_000_000) + 1))
nonce = int(file.read_text())

with SyncClient(url) as tasks:
    try:
        task = tasks.submit(Move(0.5), nonce=nonce)
    except NoAnswer:
        sys.exit("no answer: run this again, it stays one task")
    print(f"task {task.id}: {task.refresh().state.name.lower()}")
