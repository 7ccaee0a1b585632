"""Soak-test the server: random lives in virtual time, mutated packets, fuzzed parsers.

    tools/soak.py --seeds 100 --minutes 5 --jobs 2     random worlds, rules judged at each step
    tools/soak.py --seed 17 --minutes 5                repeat the one that failed
    tools/soak.py --packets 1000000                    mutated packets
    tools/soak.py --fuzz 10                            minutes of fuzzing
    tools/soak.py --hour                               memory over an hour of 5 rovers, 10 clients

Exit code 0: no fault; 1: a fault, and its seed is printed; 2: usage error; 3: a halted rover moved
before it was released.
"""

import argparse
import logging
import sys
import time
import traceback
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "sim")]

from tests.kit.soak.battered import Battered  # noqa: E402
from tests.kit.soak.figures import Figures  # noqa: E402
from tests.kit.soak.fuzz import fuzz_for  # noqa: E402
from tests.kit.soak.hour import Hour, HourSettings  # noqa: E402
from tests.kit.soak.life import Life, live  # noqa: E402
from tests.kit.soak.many import BROKEN, many_lives, printed, python  # noqa: E402
from tests.kit.soak.signing import signed_only  # noqa: E402

BATCH = 10_000  # packets between two lines of progress


def main() -> int:
    """Run the command line; return the exit code."""
    parser = argparse.ArgumentParser(
        prog="tools/soak.py",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--seeds", type=_positive, metavar="N", help="run this many random lives")
    what.add_argument("--seed", type=int, metavar="N", help="run the life of this seed")
    what.add_argument(
        "--packets", type=_positive, metavar="N", help="send this many mutated packets"
    )
    what.add_argument(
        "--fuzz", type=float, metavar="MINUTES", help="fuzz the parsers for this long"
    )
    what.add_argument("--hour", action="store_true", help="measure memory over a virtual hour")
    parser.add_argument(
        "--minutes", type=float, default=5.0, help="virtual minutes of each life (default 5)"
    )
    parser.add_argument(
        "--jobs", type=_positive, default=1, help="lives to run in parallel (default 1)"
    )
    parser.add_argument(
        "--first-seed", type=int, default=0, metavar="N", help="seed of the first life (default 0)"
    )
    parser.add_argument("--figures", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    logging.disable(logging.CRITICAL)  # thousands of logged refusals
    if arguments.seeds is not None:
        return _many(arguments)
    if arguments.seed is not None:
        return _one(arguments.seed, arguments.minutes * 60, only_figures=arguments.figures)
    if arguments.packets is not None:
        return _packets(arguments.first_seed, arguments.packets)
    if arguments.fuzz is not None:
        return _fuzz(arguments.first_seed, arguments.fuzz * 60)
    return _hour(arguments.first_seed)


def _positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError("expected a number from 1 on")
    return value


def _one(seed: int, seconds: float, *, only_figures: bool) -> int:
    print(f"seed {seed}", flush=True)
    try:
        figures = live(seed, seconds=seconds, then=_say_digest)
    except Exception:  # noqa: BLE001 - any exception is a finding
        traceback.print_exc()
        print(f"seed {seed} FAILED; again: tools/soak.py --seed {seed} --minutes {seconds / 60:g}")
        return 1
    print(printed(figures) if only_figures else "\n".join(figures.lines()))
    return BROKEN if figures.broken else 0


def _say_digest(life: Life) -> None:
    """Print the digest of all packets of a life, which is the same for the same seed."""
    for broken in life.world.broken:
        print(f"RULE BROKEN {broken}")
    print(f"digest {life.world.digest:08x}")


def _many(arguments: argparse.Namespace) -> int:
    first, count = arguments.first_seed, arguments.seeds
    seeds = range(first, first + count)
    print(f"seeds {first} to {seeds[-1]}, {arguments.minutes:g} virtual minutes each", flush=True)
    command = [*python(__file__), "--figures", "--minutes", f"{arguments.minutes}", "--seed"]
    began, total, failed = time.monotonic(), Figures(), list[int]()
    for ended in many_lives(command, seeds, jobs=arguments.jobs):
        if ended.figures is None:
            failed.append(ended.seed)
            print(f"\nseed {ended.seed} FAILED\n{ended.fault}", flush=True)
        else:
            total.add(ended.figures)
            if ended.figures.broken:
                print(f"seed {ended.seed}: rule broken {dict(ended.figures.broken)}", flush=True)
        done = total.lives + len(failed)
        print(f"{done} of {count}, {len(failed)} failed (seed {ended.seed})", flush=True)
    print("\n".join(total.lines()))
    print(f"wall         {time.monotonic() - began:.0f} s")
    print(f"failed       {len(failed)}: {' '.join(map(str, sorted(failed)))}")
    return 1 if failed else BROKEN if total.broken else 0


def _packets(seed: int, count: int) -> int:
    print(f"seed {seed}, {count} packets", flush=True)
    began = time.process_time()
    # every fifth packet goes to a server that checks signatures
    both = battered, signed = Battered(seed), signed_only(seed)
    quarter = 0
    try:
        for done in range(0, count, BATCH):
            batch = min(BATCH, count - done)
            battered.run(batch - batch // 5)
            signed.run(batch // 5)
            kept = sum(each.entries() for each in both)
            quarter = quarter or (kept if done + batch >= count / 4 else 0)
            print(f"{done + batch}: {kept} entries kept", flush=True)
    except Exception:  # noqa: BLE001 - any exception is a finding
        traceback.print_exc()
        print(f"seed {seed} FAILED; again: tools/soak.py --packets {count} --first-seed {seed}")
        return 1
    for how, number in sorted((battered.counts + signed.counts).items()):
        print(f"  {how:<18} {number}")
    print(f"signed       {signed.engine.signatures.counts}")
    print(f"entries      {quarter} after the first quarter, {kept} in the end")
    print(f"processor    {time.process_time() - began:.0f} s")
    return 0


def _fuzz(seed: int, seconds: float) -> int:
    print(f"seed {seed}, {seconds:.0f} s", flush=True)
    crashes = fuzz_for(seconds, seed=seed, say=lambda line: print(line, flush=True))
    for crash in crashes:
        print(f"FAILED: {crash}")
    return 1 if crashes else 0


def _hour(seed: int) -> int:
    hour = Hour(HourSettings(), seed=seed)
    try:
        for line in hour.run():
            print(line, flush=True)
    except AssertionError as error:
        print(f"FAILED: {error}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
