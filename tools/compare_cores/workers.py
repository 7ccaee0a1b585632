"""Compares many records, each in one of a few processes, each beside one of the old revision."""

import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from . import looking
from .compared import Compared, Comparison
from .inside.expand import layouts as layouts_of_this_core
from .recorded import INSIDE, Recorded, environment
from .wire import Layouts

#: a revision that has it asks a rover for a heartbeat before it takes it
LOOKS = Path("mav_tasks", "services", "news.py")
AT_A_TIME = 8  # records that a process is given at once


def compare_all(tree: Path, records: Sequence[Recorded], *, jobs: int) -> Iterator[Compared]:
    """Give what came of each record, in any order."""
    shares = [records[at : at + AT_A_TIME] for at in range(0, len(records), AT_A_TIME)]
    with ProcessPoolExecutor(jobs) as pool:
        for done in as_completed([pool.submit(compare_some, tree, share) for share in shares]):
            yield from done.result()


def compare_some(tree: Path, records: Sequence[Recorded]) -> list[Compared]:
    """Compare records one after the other with one process of the old revision."""
    if not (tree / LOOKS).exists():
        looking.leave_out()
    process = subprocess.Popen(
        [sys.executable, str(INSIDE / "expand.py")],
        cwd=tree,
        env=environment(tree),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        old = _by_number(json.loads(process.stdout.readline())["layouts"])
        found: list[Compared] = []
        for record in records:
            asked = {"record": str(record.path), "secrets": record.secrets}
            process.stdin.write(json.dumps(asked) + "\n")
            process.stdin.flush()
            secrets = {name: bytes.fromhex(text) for name, text in record.secrets.items()}
            comparison = Comparison(
                record.whose, old=old, new=layouts_of_this_core(), secrets=secrets
            )
            found.append(comparison.run(iter(process.stdout)))
        return found
    finally:
        process.stdin.close()
        process.stdout.close()
        process.wait()


def _by_number(layouts: dict[str, list[object]]) -> Layouts:
    return {int(number): layout for number, layout in layouts.items()}
