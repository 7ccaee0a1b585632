"""Has another revision record its own decisions: scenarios, soak lives, tests with processes."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

INSIDE = Path(__file__).with_name("inside")
SUFFIX = ".decisions.gz"
INDEX = "index-*.jsonl"


@dataclass(frozen=True)
class Recorded:
    """One record, whose it is, and the secrets of its keys in hex, by name and fingerprint."""

    path: Path
    whose: str
    secrets: dict[str, str]


def environment(tree: Path, **more: str) -> dict[str, str]:
    """Give what a process needs to run inside a tree."""
    path = os.pathsep.join(map(str, (tree, tree / "sim", INSIDE)))
    return {**os.environ, "PYTHONPATH": path, "MAV_TASKS_CONFIG": "", **more}


def record_tests(tree: Path, folder: Path, arguments: Sequence[str], *, jobs: int) -> int:
    """Run tests of a tree with every server recorded; gives pytest's exit code."""
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "record_plugin",
        "-p",
        "no:cacheprovider",
    ]
    command += ["-n", str(jobs) if jobs > 1 else "0", *arguments]
    more = {"RECORD_INTO": str(folder), "RECORD_PROCESSES": "1"}
    output = folder / "pytest.txt"
    with output.open("wb") as sink:
        return subprocess.run(
            command,
            cwd=tree,
            env=environment(tree, **more),
            stdout=sink,
            stderr=subprocess.STDOUT,
            check=False,
        ).returncode


def record_lives(
    tree: Path, folder: Path, seeds: Sequence[int], *, minutes: float, jobs: int
) -> list[str]:
    """Record soak lives; gives a line for each."""
    shares = [share for share in (seeds[number::jobs] for number in range(jobs)) if share]
    command = [sys.executable, str(INSIDE / "record_lives.py"), str(folder), str(minutes)]
    running = [
        subprocess.Popen(
            [*command, *map(str, share)],
            cwd=tree,
            env=environment(tree),
            stdout=subprocess.PIPE,
            text=True,
        )
        for share in shares
    ]
    return [line for process in running for line in process.communicate()[0].splitlines()]


def records_in(folder: Path) -> Iterator[Recorded]:
    """Give every record of a folder, by name."""
    known: dict[str, dict[str, object]] = {}
    for index in folder.glob(INDEX):
        for line in index.read_text("utf-8").splitlines():
            told = json.loads(line)
            known[told["record"]] = told
    for path in sorted(folder.glob(f"*{SUFFIX}")):
        told = known.get(path.name, {"whose": f"process {path.name}", "secrets": {}})
        yield Recorded(path, str(told["whose"]), dict(told["secrets"]))  # type: ignore[call-overload]
