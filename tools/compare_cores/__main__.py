"""Compares what this checkout's core decides with what another revision's did, packet by packet.

    python -m tools.compare_cores REVISION                       all its scenarios
    python -m tools.compare_cores REVISION --lives 100           and soak lives of it
    python -m tools.compare_cores REVISION --tests tests/scenarios/test_stop.py --tests tests/e2e
    python -m tools.compare_cores REVISION --records FOLDER      its records in a folder

The revision is put into a temporary folder and records its own tests there; each record goes
through its own core once more (what it does not repeat itself is of no use: tests break engines on
purpose), and beside it through this one. Differences are held against the table in ``intended.py``.

Exit code 0: the same but for what is intended; 1: something is unexplained; 2: wrong arguments.
"""

import argparse
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.kit.other_revision import checked_out

from . import report
from .recorded import record_lives, record_tests, records_in
from .workers import compare_all

SCENARIOS = "tests/scenarios"


def main() -> int:
    """Do what the command line says; gives the exit code."""
    parser = argparse.ArgumentParser(
        prog="tools.compare_cores",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("revision", help="of which git knows")
    parser.add_argument("--tests", action="append", metavar="ARGUMENT", help="for pytest")
    parser.add_argument("--lives", type=int, default=0, metavar="N", help="soak lives")
    parser.add_argument("--minutes", type=float, default=5.0, help="virtual, of each life")
    parser.add_argument("--records", type=Path, metavar="FOLDER", help="compare these only")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="leave the records there")
    parser.add_argument("--jobs", type=int, default=2, help="processes side by side")
    arguments = parser.parse_args()
    with checked_out(arguments.revision) as tree, TemporaryDirectory() as temporary:
        folder = arguments.records or arguments.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        if arguments.records is None:
            _record(tree, folder.absolute(), arguments)
        return _compare(tree, folder, jobs=arguments.jobs)


def _record(tree: Path, folder: Path, arguments: argparse.Namespace) -> None:
    began = time.monotonic()
    if arguments.tests or not arguments.lives:
        tests = arguments.tests or [SCENARIOS]
        code = record_tests(tree, folder, tests, jobs=arguments.jobs)
        text = (folder / "pytest.txt").read_text("utf-8", "replace").splitlines()
        print(f"its tests: exit code {code}: {text[-1] if text else ''}", flush=True)
    if arguments.lives:
        seeds = range(arguments.lives)
        jobs = arguments.jobs
        for line in record_lives(tree, folder, seeds, minutes=arguments.minutes, jobs=jobs):
            if not line.endswith("lived"):
                print(line, flush=True)
    print(f"recorded in {time.monotonic() - began:.0f} s", flush=True)


def _compare(tree: Path, folder: Path, *, jobs: int) -> int:
    began = time.monotonic()
    records = list(records_in(folder))
    results = list(compare_all(tree, records, jobs=jobs))
    print("\n".join(report.lines(results)))
    print(f"compared in {time.monotonic() - began:.0f} s")
    return 1 if any(each.unexplained for each in results) else 0


if __name__ == "__main__":
    sys.exit(main())
