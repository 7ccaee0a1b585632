"""Many lives, each in its own process, so that they do not affect each other."""

import json
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass

from tests.kit.soak.figures import COUNTED, Figures

BROKEN = 3  # exit code of a complete life with a breach of the halt rule


@dataclass(frozen=True)
class Ended:
    """A finished life: its figures, or its failure as text."""

    seed: int
    figures: Figures | None
    fault: str = ""


def printed(figures: Figures) -> str:
    """Return figures as one line for the parent process."""
    return json.dumps(vars(figures))


def many_lives(command: Sequence[str], seeds: range, *, jobs: int) -> Iterator[Ended]:
    """Run ``command SEED`` for each seed, up to ``jobs`` in parallel; yield each result."""
    run: Callable[[int], Ended] = lambda seed: _run([*command, str(seed)], seed)  # noqa: E731
    with ThreadPoolExecutor(jobs) as pool:
        for done in as_completed([pool.submit(run, seed) for seed in seeds]):
            yield done.result()


def python(script: str) -> list[str]:
    """Return the command that runs a script with this interpreter."""
    return [sys.executable, script]


def _run(command: Sequence[str], seed: int) -> Ended:
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    if ended.returncode not in (0, BROKEN):
        return Ended(seed, None, ended.stdout + ended.stderr)
    values = json.loads(ended.stdout.splitlines()[-1])
    values |= {name: Counter(values[name]) for name in COUNTED}
    return Ended(seed, Figures(**values))
