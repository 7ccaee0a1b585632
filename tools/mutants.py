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
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
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

SWAPS: dict[type, type] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.And: ast.Or,
    ast.Or: ast.And,
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
}


@dataclass(frozen=True)
class Mutant:
    """A fault: the number of its node in a walk over its module, and what is done to that."""

    path: str
    node: int
    line: int
    function: str
    what: str


# the faults


def changes(node: ast.AST) -> Iterator[str]:
    """Yield the kinds of faults that a node can have."""
    match node:
        case ast.Compare(ops=[op]) if type(op) in SWAPS:
            yield "compare"
        case ast.BoolOp():
            yield "and/or"
        case ast.BinOp(op=op) if type(op) in SWAPS:
            yield "arithmetic"
        case ast.AugAssign(op=op) if type(op) in SWAPS:
            yield "arithmetic"
        case ast.If() | ast.IfExp() | ast.While():
            yield "negate"
        case ast.Constant(value=bool()):
            yield "flip"
        case ast.Constant(value=int() | float()):
            yield "number"
        case ast.Return(value=value) if value is not None:
            if not (isinstance(value, ast.Constant) and value.value is None):
                yield "return None"
        case ast.Expr(value=ast.Call()) | ast.Assign(targets=[ast.Attribute()]):
            yield "leave out"


def mutate(node: Any, what: str) -> ast.AST:
    """Return the node with the fault."""
    if what == "compare":
        node.ops = [SWAPS[type(node.ops[0])]()]
    elif what in ("and/or", "arithmetic"):
        node.op = SWAPS[type(node.op)]()
    elif what == "negate":
        node.test = ast.copy_location(ast.UnaryOp(ast.Not(), node.test), node.test)
    elif what == "flip":
        node.value = not node.value
    elif what == "number":
        node.value += 1
    elif what == "return None":
        node.value = ast.copy_location(ast.Constant(None), node)
    else:
        return ast.copy_location(ast.Pass(), node)
    return node  # type: ignore[no-any-return]


def numbered(tree: ast.Module) -> dict[ast.AST, int]:
    """Return each node's number in a walk."""
    return {node: number for number, node in enumerate(ast.walk(tree))}


def functions(tree: ast.Module) -> Iterator[tuple[str, ast.FunctionDef | ast.AsyncFunctionDef]]:
    """Yield the outermost functions and methods with their qualified names."""

    def within(nodes: Iterable[ast.stmt], prefix: str) -> Iterator[Any]:
        for node in nodes:
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                yield prefix + node.name, node
            elif isinstance(node, ast.ClassDef):
                yield from within(node.body, f"{prefix}{node.name}.")

    return within(tree.body, "")


def mutants_of(path: Path) -> Iterator[Mutant]:
    """Yield all mutants of a module."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    numbers = numbered(tree)
    for name, function in functions(tree):
        if name.endswith("__repr__"):
            continue
        for statement in function.body:
            for node in ast.walk(statement):
                if isinstance(node, ast.Expr) and "log." in ast.unparse(node)[:4]:
                    continue
                for what in changes(node):
                    line: int = node.lineno  # type: ignore[attr-defined]
                    at = str(path.relative_to(ROOT))
                    yield Mutant(at, numbers[node], line, name, what)


def sample(count: int, seed: int) -> list[Mutant]:
    """Return a random sample of all mutants of the core."""
    everything = [
        mutant
        for part in CORE
        for path in sorted((ROOT / "mav_tasks" / part).rglob("*.py"))
        for mutant in mutants_of(path)
    ]
    print(f"{len(everything)} mutants in all", flush=True)
    return random.Random(seed).sample(everything, min(count, len(everything)))


def survivors(figures: Path) -> list[Mutant]:
    """Return the mutants that no test killed in an earlier run, unless the source has changed."""
    fields = Mutant.__dataclass_fields__
    found = [
        Mutant(**{name: result[name] for name in fields})
        for result in json.loads(figures.read_text(encoding="utf-8"))
        if not result["killed by"] and not result.get("unmeasured")
    ]
    present = {each for path in {it.path for it in found} for each in mutants_of(ROOT / path)}
    for mutant in found:
        if mutant not in present:
            print(f"left out, its module has changed: {mutant}", flush=True)
    return [mutant for mutant in found if mutant in present]


def mutated(mutant: Mutant) -> ast.Module:
    """Return the module with the fault."""
    tree = ast.parse((ROOT / mutant.path).read_text(encoding="utf-8"))
    wanted = next(node for node, number in numbered(tree).items() if number == mutant.node)

    class Put(ast.NodeTransformer):
        def visit(self, node: ast.AST) -> Any:
            return mutate(node, mutant.what) if node is wanted else self.generic_visit(node)

    return ast.fix_missing_locations(Put().visit(tree))  # type: ignore[no-any-return]


def probed(path: str, mutants: dict[int, Mutant]) -> ast.Module:
    """Return a module in which the statements with mutants say that they are reached."""
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    numbers = numbered(tree)
    here = {mutant.node: number for number, mutant in mutants.items() if mutant.path == path}

    class Put(ast.NodeTransformer):
        def generic_visit(self, node: ast.AST) -> ast.AST:
            for name in ("body", "orelse", "finalbody"):
                statements = getattr(node, name, None)
                if not isinstance(statements, list):
                    continue
                found: list[ast.stmt] = []
                for statement in statements:
                    for number in own(statement, numbers, here):
                        call = ast.parse(f"{PROBE}({number})").body[0]
                        for each in ast.walk(call):
                            ast.copy_location(each, statement)
                        found.append(call)
                    found.append(statement)
                setattr(node, name, found)
            return super().generic_visit(node)

    # a docstring stays the first statement: no probe is put before one, as it has no mutants
    return ast.fix_missing_locations(Put().visit(tree))  # type: ignore[no-any-return]


def own(statement: ast.stmt, numbers: dict[ast.AST, int], here: dict[int, int]) -> Iterator[int]:
    """Yield the mutants in a statement, without those in statements within it."""
    todo: list[ast.AST] = [statement]
    while todo:
        node = todo.pop()
        if numbers.get(node) in here:
            yield here[numbers[node]]
        todo += [
            child
            for child in ast.iter_child_nodes(node)
            if not isinstance(child, ast.stmt | ast.ExceptHandler | ast.match_case)
        ]
        if isinstance(node, ast.Match):  # patterns and guards of its cases
            todo += [case.guard for case in node.cases if case.guard is not None]


# their way into the running program


@cache
def running() -> dict[str, dict[tuple[str, int], list[FunctionType]]]:
    """Return the functions that exist, by file, qualified name and first line."""
    found: dict[str, dict[tuple[str, int], list[FunctionType]]] = {}
    for each in gc.get_objects():
        if type(each) is FunctionType:
            code = each.__code__
            of_file = found.setdefault(code.co_filename, {})
            of_file.setdefault((code.co_qualname, code.co_firstlineno), []).append(each)
    return found


def codes(code: CodeType) -> Iterator[CodeType]:
    """Yield the code objects in a module's."""
    for each in code.co_consts:
        if isinstance(each, CodeType):
            yield each
            yield from codes(each)


def put(tree: ast.Module, path: str, names: Iterable[str]) -> int:
    """Give functions the code of a changed module, by their names; return how many got it."""
    whole = str(ROOT / path)
    wanted, done = set(names), 0
    for code in codes(compile(tree, whole, "exec", dont_inherit=True)):
        if code.co_qualname in wanted:
            for function in (
                running().get(whole, {}).get((code.co_qualname, code.co_firstlineno), ())
            ):
                if function.__code__.co_freevars == code.co_freevars:
                    function.__code__ = code
                    done += 1
    return done


class Loop:
    """The pytest plugin that runs the tests in forked processes."""

    def __init__(self, mutants: list[Mutant], jobs: int, folder: Path) -> None:
        self.mutants = dict(enumerate(mutants))
        self.jobs = jobs
        self.failed = False
        self.results: list[dict[str, Any]] = []
        self.tests = 0
        self.folder = folder

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
        self.tests = len(session.items)
        began = time.monotonic()
        by_file: dict[Path, list[int]] = {}
        for index, item in enumerate(session.items):
            by_file.setdefault(item.path, []).append(index)
        files = sorted(by_file.values(), key=len, reverse=True)
        done = self.forked([(self.reach, session, each) for each in files])
        reached = [one for found in done if isinstance(found, list) for one in found]
        print(f"{len(reached)} tests in {time.monotonic() - began:.0f} s", flush=True)
        reaching: dict[int, list[tuple[float, int]]] = {number: [] for number in self.mutants}
        for index, seconds, passed, numbers in reached:
            if not passed:
                print(f"fails without a mutant: {session.items[index].nodeid}", flush=True)
                continue
            for number in numbers:
                reaching[number].append((seconds, index))
        jobs = [
            (self.attempt, session, number, sorted(tests)) for number, tests in reaching.items()
        ]
        self.results = self.forked(jobs)
        return True

    def reach(self, session: pytest.Session, indices: list[int]) -> list[Any]:
        """Run the tests of a file; return for each its time, its success, and what it reached."""
        seen: set[int] = set()
        for path in {mutant.path for mutant in self.mutants.values()}:
            names = {m.function for m in self.mutants.values() if m.path == path}
            put(probed(path, self.mutants), path, names)
            for functions_ in running().get(str(ROOT / path), {}).values():
                for function in functions_:
                    function.__globals__[PROBE] = seen.add
        found = []
        for index in indices:
            seen.clear()
            began = time.monotonic()
            passed = self.run(session, index)
            found.append((index, time.monotonic() - began, passed, sorted(seen)))
        return found

    def attempt(
        self, session: pytest.Session, number: int, tests: list[tuple[float, int]]
    ) -> dict[str, Any]:
        """Run the tests that reach a mutant until one fails."""
        mutant = self.mutants[number]
        what = {"number": number, **vars(mutant), "reached by": len(tests), "killed by": None}
        if not put(mutated(mutant), mutant.path, [mutant.function]):
            return {**what, "unmeasured": True}
        end = time.process_time() + BUDGET
        for _, index in tests:
            if time.process_time() > end:
                return {**what, "killed by": None, "budget": True}
            if not self.run(session, index):
                return {**what, "killed by": session.items[index].nodeid}
        return what

    def run(self, session: pytest.Session, index: int) -> bool:
        """Run one test; return whether it passed."""
        self.failed = False
        item = session.items[index]
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=None)
        return not self.failed

    def forked(self, jobs: list[tuple[Any, ...]]) -> list[Any]:
        """Do each job in a process of its own, so many at once; return their results."""
        results: list[Any] = []
        under_way: dict[int, tuple[int, Path]] = {}
        todo = list(enumerate(jobs))
        while todo or under_way:
            while todo and len(under_way) < self.jobs:
                number, job = todo.pop(0)
                file = self.folder / f"{number}.json"
                pid = os.fork()
                if not pid:
                    self._child(job, file)
                under_way[pid] = number, file
            pid, _ = os.wait()
            if pid in under_way:
                number, file = under_way.pop(pid)
                if file.exists():
                    found = json.loads(file.read_text(encoding="utf-8"))
                    file.unlink()
                else:  # it died, of whatever
                    found = {"number": number, "killed by": None, "unmeasured": True}
                results.append(found)
                if isinstance(found, dict):
                    print(len(results), json.dumps(found), flush=True)
        return results

    @staticmethod
    def _child(job: tuple[Any, ...], file: Path) -> None:
        function, session, *arguments = job
        nothing = os.open(os.devnull, os.O_RDWR)
        os.dup2(nothing, 1)
        os.dup2(nothing, 2)
        try:
            with tempfile.TemporaryDirectory() as folder:
                factory = session.config._tmp_path_factory
                factory._basetemp, factory._given_basetemp = None, Path(folder, "base")
                found = function(session, *arguments)
                file.write_text(json.dumps(found), encoding="utf-8")
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
        print(mutant)
        before = (ROOT / mutant.path).read_text(encoding="utf-8")
        print(before.splitlines()[mutant.line - 1])
        return 0
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        return measure(options, mutants, Path(folder))


def measure(options: argparse.Namespace, mutants: list[Mutant], folder: Path) -> int:
    """Run the tests and print the figures; return the exit code."""
    loop = Loop(mutants, options.jobs, folder)
    os.chdir(ROOT)
    sys.path[:0] = [str(ROOT), str(ROOT / "sim")]
    arguments = [*options.only, "-q", "--capture=sys", "-p", "no:cacheprovider", "-n", "0"]
    arguments += ["-p", "no:randomly", "-o", "timeout=600"]
    arguments += [f"--ignore=tests/{each}" for each in LEFT_OUT]
    status = pytest.main(arguments, plugins=[loop])
    if status not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED) or not loop.results:
        return 2
    measured = [each for each in loop.results if not each.get("unmeasured")]
    killed = [each for each in measured if each["killed by"]]
    never = [each for each in measured if not each.get("reached by", 1)]
    print(
        f"{len(killed)} of {len(measured)} killed by {loop.tests} tests; {len(never)} not reached;"
        f" {len(mutants) - len(measured)} not measured"
    )
    for each in measured:
        if not each["killed by"]:
            print(f"survives: {each['path']}:{each['line']} {each['function']}: {each['what']}")
    if options.out:
        options.out.write_text(json.dumps(loop.results, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
