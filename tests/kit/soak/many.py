"""Many lives, each in a process of its own: what one leaves behind is not the next one's."""

import json
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass

from tests.kit.soak.figures import COUNTED, Figures

BROKEN = 3  # exit code of a life that was lived to its end, in which the rule of halts was broken


@dataclass(frozen=True)
class Ended:
    """A life that is over: its figures, or in words what went wrong."""

    seed: int
    figures: Figures | None
    fault: str = ""


def printed(figures: Figures) -> str:
    """Return figures as one line for whoever started this process."""
    return json.dumps(vars(figures))


def many_lives(command: Sequence[str], seeds: range, *, jobs: int) -> Iterator[Ended]:
    """Run ``command SEED`` for each seed, so many side by side; gives each when it is over."""
    run: Callable[[int], Ended] = lambda seed: _run([*command, str(seed)], seed)  # noqa: E731
    with ThreadPoolExecutor(jobs) as pool:
        for done in as_completed([pool.submit(run, seed) for seed in seeds]):
            yield done.result()


def python(script: str) -> list[str]:
    """Return how this interpreter runs a script."""
    return [sys.executable, script]


def _run(command: Sequence[str], seed: int) -> Ended:
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    if ended.returncode not in (0, BROKEN):
        return Ended(seed, None, ended.stdout + ended.stderr)
    values = json.loads(ended.stdout.splitlines()[-1])
    values |= {name: Counter(values[name]) for name in COUNTED}
    return Ended(seed, Figures(**values))
