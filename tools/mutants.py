"""Mutation score of the tests: small faults are put into the core, and some test must fail.

    tools/mutants.py --count 200 --seed 1 --out figures.json         by all tests that only compute
    tools/mutants.py --count 200 --seed 1 --only tests/scenarios     by these tests alone
    tools/mutants.py --mutants figures.json --only tests/unit        the survivors of a run, again

The mutants are a random sample, the same for the same seed and source. First each test runs once,
which records the mutants whose lines it reaches; then for each mutant those tests run, quick ones
first, until one fails, in a process that imports the changed module. Only code within functions is
mutated, not tables of modules. Tests with real processes are left out. Exit code 0: measured.
"""

import argparse
import ast
import builtins
import json
import os
import random
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from importlib.machinery import SourceFileLoader
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

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
#: of modules: the nodes that get faults, and the numbers of the nodes that are watched
Changes = dict[str, tuple[list[int], dict[int, int]]]
#: of tests: name, seconds, whether it passed, and what of the watched it reached
Results = list[tuple[str, float, bool, set[int]]]


class Mutant(NamedTuple):
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
    found = [
        Mutant(*(result[name] for name in Mutant._fields))
        for result in json.loads(figures.read_text(encoding="utf-8"))
        if not result["killed by"] and not result.get("unmeasured")
    ]
    present = {each for path in {it.path for it in found} for each in mutants_of(path)}
    for mutant in {*found} - present:
        print(f"left out, its module has changed: {mutant}", flush=True)
    return [mutant for mutant in found if mutant in present]


def changed(path: str, faults: list[int], probes: dict[int, int]) -> ast.Module:
    """Return a module with faults at nodes, and with calls that tell when others are reached."""
    tree = parsed(path)
    nodes = list(ast.walk(tree))
    parents = {child: node for node in nodes for child in ast.iter_child_nodes(node)}
    for number, at in probes.items():
        statement = nodes[at]
        while not isinstance(statement, ast.stmt):
            statement = parents[statement]
        call = ast.copy_location(ast.parse(f"{PROBE}({number})").body[0], statement)
        for block in vars(parents[statement]).values():
            if isinstance(block, list) and statement in block:
                block.insert(block.index(statement), call)
    for at in faults:
        found = fault(nodes[at])
        vars(nodes[at]).update(found[1] if found else {})
    return ast.fix_missing_locations(tree)


class Watch:
    """The pytest plugin of a process that runs tests: what each reached, and whether it passed."""

    def __init__(self) -> None:
        self.seen: set[int] = set()
        self.has_failed = False
        self.results: Results = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note a failure."""
        self.has_failed |= report.failed

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Note the time of a test and what it reaches, not what its module's import reached."""
        self.seen.clear()
        self.has_failed = False
        began = time.monotonic()
        done = yield
        seconds = time.monotonic() - began
        self.results.append((item.nodeid, seconds, not self.has_failed, {*self.seen}))
        if time.process_time() > BUDGET and item.config.option.maxfail:
            item.session.shouldstop = "budget"
        return done


def inside(tests: list[str], changes: Changes) -> Results | None:
    """Run tests with changed modules, silently; return the results, or None if pytest failed.

    It changes its process, and may end it.
    """
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.dup2(1, 2)
    trees = {str(ROOT / path): changed(path, *how) for path, how in changes.items()}
    get_code, watch = SourceFileLoader.get_code, Watch()
    vars(builtins)[PROBE] = watch.seen.add

    def code(loader: SourceFileLoader, name: str) -> Any:
        if loader.path in trees:
            return compile(trees[loader.path], loader.path, "exec", dont_inherit=True)
        return get_code(loader, name)

    SourceFileLoader.get_code = code  # type: ignore[method-assign, assignment]
    sys.path[:0] = [str(ROOT), str(ROOT / "sim")]
    options = ["-q", "-p", "no:cacheprovider", "-n0", "-p", "no:randomly", "-o", "timeout=600"]
    options += ["-x"] if any(faults for faults, _ in changes.values()) else []
    status = pytest.main([*tests, *options], plugins=[watch])
    if status == pytest.ExitCode.INTERRUPTED and not watch.results:  # the import fails
        watch.results.append(("collection", 0.0, False, set()))
    return watch.results if status <= pytest.ExitCode.INTERRUPTED else None


def run(tests: list[str], changes: Changes) -> Results | None:
    """Run tests in a process of their own; return the results, None if it died."""
    with suppress(BrokenProcessPool), ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(inside, tests, changes).result()
    return None


def reached(mutants: list[Mutant], paths: list[str], jobs: int) -> list[list[tuple[float, str]]]:
    """Return for each mutant the tests that pass and reach it, the quickest first."""
    probes: Changes = {mutant.path: ([], {}) for mutant in mutants}
    for number, mutant in enumerate(mutants):
        probes[mutant.path][1][number] = mutant.node
    files = [str(file) for path in map(Path, paths) for file in path.rglob("test_*.py")]
    kept = [each for each in files if not each.startswith(tuple(f"tests/{it}" for it in LEFT_OUT))]
    kept += [path for path in paths if not Path(path).is_dir()]
    found: list[list[tuple[float, str]]] = [[] for _ in mutants]
    began, count = time.monotonic(), 0
    with ThreadPoolExecutor(jobs) as pool:
        for results in pool.map(lambda file: run([file], probes), kept):
            for test, seconds, passed, numbers in results or ():
                count += 1
                for number in numbers if passed else ():
                    found[number].append((seconds, test))
                if not passed:
                    print(f"fails without a mutant: {test}", flush=True)
    print(f"{count} tests in {time.monotonic() - began:.0f} s", flush=True)
    return [sorted(each) for each in found]


def attempt(mutant: Mutant, tests: list[tuple[float, str]]) -> dict[str, Any]:
    """Run the tests that reach a mutant until one fails."""
    what = {**mutant._asdict(), "reached by": len(tests)}
    results = run([test for _, test in tests], {mutant.path: ([mutant.node], {})}) if tests else []
    what["killed by"] = next((test for test, _, passed, _ in results or () if not passed), None)
    what |= {"unmeasured": True} if results is None else {}
    print(json.dumps(what), flush=True)
    return what


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        prog="tools/mutants.py",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    for name, default in (("count", 200), ("seed", 1), ("jobs", 2)):
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--only", nargs="*", default=["tests"], metavar="PATH")
    for name in ("mutants", "out"):
        parser.add_argument(f"--{name}", type=Path, metavar="FILE")
    options = parser.parse_args()
    again = options.mutants
    mutants = survivors(again) if again else sample(options.count, options.seed)
    os.chdir(ROOT)
    for path in options.only:
        if not Path(path.partition("::")[0]).exists():
            parser.error(f"no such file: {path}")
    tests = reached(mutants, options.only, options.jobs)
    with ThreadPoolExecutor(options.jobs) as pool:
        results = [*pool.map(attempt, mutants, tests)]
    measured = [each for each in results if "unmeasured" not in each]
    alive = [each for each in measured if not each["killed by"]]
    print(f"{len(measured) - len(alive)} of {len(measured)} killed;", end=" ")
    print(f"{tests.count([])} not reached; {len(mutants) - len(measured)} not measured")
    for each in alive:
        print(f"survives: {each['path']}:{each['line']} {each['function']}: {each['what']}")
    if options.out:
        options.out.write_text(json.dumps(results, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
