"""Mutation score of the tests: small faults are put into the core, and some test must fail.

    tools/mutants.py --count 200 --seed 1 --out figures.json         by all tests that only compute
    tools/mutants.py --count 200 --seed 1 --only tests/scenarios     by these tests alone
    tools/mutants.py --mutants figures.json --only tests/unit        the survivors of a run, again
    tools/mutants.py --show 17 --seed 1                              print one mutant

The mutants are a random sample, the same for the same seed and source. First each test runs once,
which records the mutants whose lines it reaches; then for each mutant those tests run, quick ones
first, until one fails. Only code within functions is mutated, not tables of modules. Tests with
real processes are left out. Exit code 0: measured; 2: usage error.
"""

import argparse
import ast
import gc
import json
import os
import random
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, fields
from functools import cache, partial
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parent.parent
CORE = ("engine", "tasks")
#: tests that only compute: tools/test runs the others beside them
LEFT_OUT = (
    *("browser", "e2e", "interop", "test_documents.py", "sim", "unit/fleet/io"),
    *("unit/links", "unit/recording", "unit/store", "unit/rover_sim", "unit/tools"),
    "test_forbidden.py",
)
BUDGET = 120.0  # s of processor time, after which a mutant counts as one that survived
PROBE = "_reached_mutant"
PAIRS = ["Lt LtE", "Gt GtE", "Eq NotEq", "Is IsNot", "In NotIn", "And Or", "Add Sub", "Mult Div"]
SWAPS = {getattr(ast, a): getattr(ast, b) for a, b in map(str.split, PAIRS)}
SWAPS |= {b: a for a, b in SWAPS.items()}


@dataclass(frozen=True)
class Mutant:
    """A fault: the number of its node in a walk over its module, and what is done to that."""

    path: str
    node: int
    line: int
    function: str
    what: str


def fault(node: ast.AST) -> tuple[str, dict[str, Any]] | None:
    """Return the kind of a node's fault, and the node's fields with it; None: it can have none."""
    match node:
        case ast.Compare(ops=[op]) if type(op) in SWAPS:
            return "compare", {"ops": [SWAPS[type(op)]()]}
        case ast.BoolOp(op=op):
            return "and/or", {"op": SWAPS[type(op)]()}
        case ast.BinOp(op=op) | ast.AugAssign(op=op) if type(op) in SWAPS:
            return "arithmetic", {"op": SWAPS[type(op)]()}
        case ast.If(test=test) | ast.IfExp(test=test) | ast.While(test=test):
            return "negate", {"test": ast.UnaryOp(ast.Not(), test)}
        case ast.Constant(value=bool(value)):
            return "flip", {"value": not value}
        case ast.Constant(value=int(value) | float(value)):
            return "number", {"value": value + 1}
        case ast.Return(value=ast.expr() as given) if ast.unparse(given) != "None":
            return "return None", {"value": ast.Constant(None)}
        case ast.Expr(value=ast.Call()):
            return "leave out", {"value": ast.Constant(None)}
        case ast.Assign(targets=[ast.Attribute()]):
            unused = ast.Name("_", ast.Store())
            return "leave out", {"targets": [unused], "value": ast.Constant(None)}
    return None


def parsed(path: str | Path) -> ast.Module:
    """Return the syntax tree of a file of the project."""
    return ast.parse((ROOT / path).read_text(encoding="utf-8"))


def functions(body: list[ast.stmt], prefix: str = "") -> Iterator[tuple[str, list[ast.stmt]]]:
    """Yield the outermost functions and methods: qualified names and bodies."""
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield prefix + node.name, node.body
        elif isinstance(node, ast.ClassDef):
            yield from functions(node.body, f"{prefix}{node.name}.")


def mutants_of(path: str) -> Iterator[Mutant]:
    """Yield all mutants of a module."""
    tree = parsed(path)
    numbers = {node: number for number, node in enumerate(ast.walk(tree))}
    for name, body in functions(tree.body):
        for node in [each for statement in body for each in ast.walk(statement)]:
            is_log = isinstance(node, ast.Expr) and ast.unparse(node).startswith("log.")
            if (found := fault(node)) and not is_log and not name.endswith("__repr__"):
                line = vars(node)["lineno"]
                yield Mutant(path, numbers[node], line, name, found[0])


def sample(count: int, seed: int) -> list[Mutant]:
    """Return a random sample of all mutants of the core."""
    files = [path for part in CORE for path in sorted((ROOT / "mav_tasks" / part).rglob("*.py"))]
    everything = [each for path in files for each in mutants_of(str(path.relative_to(ROOT)))]
    print(f"{len(everything)} mutants in all", flush=True)
    return random.Random(seed).sample(everything, min(count, len(everything)))


def survivors(figures: Path) -> list[Mutant]:
    """Return the mutants that no test killed in an earlier run, unless the source has changed."""
    names = [each.name for each in fields(Mutant)]
    found = [
        Mutant(*(result[name] for name in names))
        for result in json.loads(figures.read_text(encoding="utf-8"))
        if not result["killed by"] and not result.get("unmeasured")
    ]
    present = {each for path in {it.path for it in found} for each in mutants_of(path)}
    for mutant in found:
        if mutant not in present:
            print(f"left out, its module has changed: {mutant}", flush=True)
    return [mutant for mutant in found if mutant in present]


def mutated(mutant: Mutant) -> ast.Module:
    """Return the module with the fault."""
    tree = parsed(mutant.path)
    node = list(ast.walk(tree))[mutant.node]
    made = fault(node)
    assert made is not None, mutant
    vars(node).update(made[1])
    return tree


def probed(path: str, here: dict[int, Mutant]) -> ast.Module:
    """Return a module in which the statements with mutants say that they are reached."""
    tree = parsed(path)
    nodes = list(ast.walk(tree))
    parents = {child: node for node in nodes for child in ast.iter_child_nodes(node)}
    for number, mutant in here.items():
        statement = nodes[mutant.node]
        while not isinstance(statement, ast.stmt):
            statement = parents[statement]
        call = ast.copy_location(ast.parse(f"{PROBE}({number})").body[0], statement)
        for block in vars(parents[statement]).values():
            if isinstance(block, list) and statement in block:
                block.insert(block.index(statement), call)
    return tree


@cache
def running() -> dict[tuple[str, str, int], list[FunctionType]]:
    """Return the functions that exist, by file, qualified name and first line."""
    found = defaultdict(list)
    for each in gc.get_objects():
        if type(each) is FunctionType:
            code = each.__code__
            found[code.co_filename, code.co_qualname, code.co_firstlineno].append(each)
    return found


def codes(code: CodeType) -> Iterator[CodeType]:
    """Yield the code objects in a module's."""
    for each in code.co_consts:
        if isinstance(each, CodeType):
            yield each
            yield from codes(each)


def put(tree: ast.Module, path: str, names: set[str]) -> list[FunctionType]:
    """Give functions the code of a changed module, by their names; return those that got it."""
    whole, done = str(ROOT / path), []
    module = compile(ast.fix_missing_locations(tree), whole, "exec", dont_inherit=True)
    for code in codes(module):
        for each in running().get((whole, code.co_qualname, code.co_firstlineno), ()):
            if code.co_qualname in names and each.__code__.co_freevars == code.co_freevars:
                each.__code__ = code
                done.append(each)
    return done


class Loop:
    """The pytest plugin that runs the tests in forked processes."""

    def __init__(self, mutants: list[Mutant], at_once: int) -> None:
        self.mutants = dict(enumerate(mutants))
        self.at_once = at_once
        self.failed = False
        self.results: list[dict[str, Any]] = []
        self.items: list[pytest.Item] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note a failure."""
        self.failed |= report.failed

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Record what the tests reach, then try each mutant."""
        gc.unfreeze()  # what is frozen is not found
        gc.collect()
        running()
        gc.freeze()  # what is collected would copy pages
        self.items, began = session.items, time.monotonic()
        by_file: dict[Path, list[int]] = defaultdict(list)
        for index, item in enumerate(self.items):
            by_file[item.path].append(index)
        files = sorted(by_file.values(), key=len, reverse=True)
        done = self.forked([partial(self.reach, each) for each in files])
        reached = [one for found in done for one in found or ()]
        print(f"{len(reached)} tests in {time.monotonic() - began:.0f} s", flush=True)
        reaching: dict[int, list[tuple[float, int]]] = {number: [] for number in self.mutants}
        for index, seconds, passed, numbers in reached:
            if not passed:
                print(f"fails without a mutant: {self.items[index].nodeid}", flush=True)
            for number in numbers if passed else ():
                reaching[number].append((seconds, index))
        jobs = [partial(self.attempt, each, sorted(tests)) for each, tests in reaching.items()]
        for number, found in enumerate(self.forked(jobs)):  # in vain: it died, of whatever
            lost = {"number": number, "killed by": None, "unmeasured": True}
            self.results.append(found or lost)
        return True

    def reach(self, indices: list[int]) -> list[Any]:
        """Run the tests of a file; return for each its time, its success, and what it reached."""
        seen: set[int] = set()
        for path in {mutant.path for mutant in self.mutants.values()}:
            here = {number: it for number, it in self.mutants.items() if it.path == path}
            for each in put(probed(path, here), path, {it.function for it in here.values()}):
                each.__globals__[PROBE] = seen.add
        found = []
        for index in indices:
            seen.clear()
            began = time.monotonic()
            passed = self.run(index)
            found.append((index, time.monotonic() - began, passed, sorted(seen)))
        return found

    def attempt(self, number: int, tests: list[tuple[float, int]]) -> dict[str, Any]:
        """Run the tests that reach a mutant until one fails."""
        mutant = self.mutants[number]
        what = {"number": number, **asdict(mutant), "reached by": len(tests), "killed by": None}
        if not put(mutated(mutant), mutant.path, {mutant.function}):
            return {**what, "unmeasured": True}
        end = time.process_time() + BUDGET
        for _, index in tests:
            if time.process_time() > end:
                return {**what, "budget": True}
            if not self.run(index):
                return {**what, "killed by": self.items[index].nodeid}
        return what

    def run(self, index: int) -> bool:
        """Run one test; return whether it passed."""
        self.failed = False
        item = self.items[index]
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=None)
        return not self.failed

    def forked(self, jobs: list[Callable[[], Any]]) -> list[Any]:
        """Do each job in a process of its own, so many at once; return results, None if lost."""
        results: list[Any] = [None] * len(jobs)
        under_way: dict[int, tuple[int, Path]] = {}
        todo = list(enumerate(jobs))
        with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
            while todo or under_way:
                while todo and len(under_way) < self.at_once:
                    number, job = todo.pop(0)
                    file = Path(folder, f"{number}.json")
                    if not (pid := os.fork()):
                        self.child(job, file)
                    under_way[pid] = number, file
                pid, _ = os.wait()
                number, file = under_way.pop(pid, (0, Path("/nowhere")))
                if file.exists():
                    results[number] = json.loads(file.read_text(encoding="utf-8"))
                    if isinstance(results[number], dict):
                        print(json.dumps(results[number]), flush=True)
        return results

    def child(self, job: Callable[[], Any], file: Path) -> None:
        """Do a job in silence, with temporary files of its own, and end."""
        nothing = os.open(os.devnull, os.O_RDWR)
        os.dup2(nothing, 1)
        os.dup2(nothing, 2)
        try:
            with tempfile.TemporaryDirectory() as folder:
                factory: Any = self.items[0].config
                factory = factory._tmp_path_factory
                factory._basetemp, factory._given_basetemp = None, Path(folder, "base")
                file.write_text(json.dumps(job()), encoding="utf-8")
        finally:
            os._exit(0)  # whatever was raised: what the parent has to clean up is not the child's


def main() -> int:
    """Run the command line; return the exit code."""
    parser = argparse.ArgumentParser(
        prog="tools/mutants.py",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", nargs="*", default=["tests"], metavar="PATH")
    parser.add_argument("--mutants", type=Path, metavar="FILE")
    parser.add_argument("--show", type=int, metavar="N")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    again = options.mutants
    mutants = survivors(again) if again else sample(options.count, options.seed)
    if options.show is not None:
        mutant = mutants[options.show]
        lines = (ROOT / mutant.path).read_text(encoding="utf-8").splitlines()
        print(mutant, lines[mutant.line - 1], sep="\n")
        return 0
    loop = Loop(mutants, options.jobs)
    os.chdir(ROOT)
    sys.path[:0] = [str(ROOT), str(ROOT / "sim")]
    arguments = ["-q", "--capture=sys", "-p", "no:cacheprovider", "-n", "0", "-p", "no:randomly"]
    arguments += ["-o", "timeout=600", *(f"--ignore=tests/{each}" for each in LEFT_OUT)]
    status = pytest.main([*options.only, *arguments], plugins=[loop])
    if status not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED) or not loop.results:
        return 2
    measured = [each for each in loop.results if not each.get("unmeasured")]
    alive = [each for each in measured if not each["killed by"]]
    never = [each for each in alive if not each["reached by"]]
    print(
        f"{len(measured) - len(alive)} of {len(measured)} killed by {len(loop.items)} tests;"
        f" {len(never)} not reached; {len(mutants) - len(measured)} not measured"
    )
    for each in alive:
        print(f"survives: {each['path']}:{each['line']} {each['function']}: {each['what']}")
    if options.out:
        options.out.write_text(json.dumps(loop.results, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
