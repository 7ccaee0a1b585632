"""What no file of ours may do: run a shell, make code of data, or guess at secrets."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ("mav_tasks", "sim", "tools")

#: functions by their full names -> why not
FUNCTIONS = {
    "os.system": "runs a shell",
    "os.popen": "runs a shell",
    "subprocess.getoutput": "runs a shell",
    "subprocess.getstatusoutput": "runs a shell",
    "asyncio.create_subprocess_shell": "runs a shell",
    "pty.spawn": "runs a shell",
    "eval": "makes code of data",
    "exec": "makes code of data",
    "compile": "makes code of data",
    "builtins.eval": "makes code of data",
    "builtins.exec": "makes code of data",
    "builtins.compile": "makes code of data",
    "yaml.load": "makes objects of data; safe_load does not",
    "yaml.load_all": "makes objects of data; safe_load_all does not",
    "yaml.full_load": "makes objects of data; safe_load does not",
    "yaml.unsafe_load": "makes objects of data; safe_load does not",
    "tempfile.mktemp": "somebody else may make the file first; mkstemp does not let them",
}
MODULES = {
    "pickle": "makes code of data",
    "cPickle": "makes code of data",
    "_pickle": "makes code of data",
    "dill": "makes code of data",
    "marshal": "makes code of data",
    "shelve": "makes code of data",
    "random": "can be guessed; secrets, os.urandom or random.SystemRandom cannot",
}
#: of a module that may not be used, what may
EXCEPT = frozenset({"random.SystemRandom"})
#: of a call, whoever is called: a keyword and the value that it may not have
KEYWORDS = {"shell": "runs a shell", "allow_pickle": "makes code of data"}
PROCESSES = frozenset(
    f"subprocess.{name}" for name in ("run", "call", "check_call", "check_output", "Popen")
)

#: (file, what it may do all the same) -> why
ALLOWED = {
    ("tools/mutants.py", "random"): "a sample of all faults, by a seed",
    ("tools/mutants.py", "compile"): "code of this repository, with a fault in it",
    ("sim/rover_sim/planar.py", "random"): "how a simulated body differs from others, by a seed",
    ("mav_tasks/links/memory.py", "random"): "the virtual net loses packets by a seed",
    ("sim/rover_sim/bullet.py", "random"): "sensor noise of a simulated rover, by a seed",
    ("sim/rover_sim/estimator.py", "random"): "sensor noise of a simulated rover, by a seed",
    ("sim/rover_sim/timing.py", "random"): "how late a simulated rover answers, by a seed",
}


def forbidden(source: str) -> Iterator[tuple[int, str, str]]:
    """Yield (line, what, why) of all that a source does and may not."""
    tree = ast.parse(source)
    names = dict(_imported(tree))
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            for name in _modules(node):
                module = name.partition(".")[0]
                if module in MODULES and name not in EXCEPT:
                    yield node.lineno, module, MODULES[module]
        elif isinstance(node, ast.Name | ast.Attribute):
            full = _full_name(node, names)
            if full in FUNCTIONS:
                yield node.lineno, full, FUNCTIONS[full]
        if isinstance(node, ast.Call):
            for keyword in node.keywords:
                is_off = isinstance(keyword.value, ast.Constant) and not keyword.value.value
                if keyword.arg in KEYWORDS and not is_off:
                    yield node.lineno, f"{keyword.arg}=", KEYWORDS[keyword.arg]
            if _full_name(node.func, names) in PROCESSES and _is_text(_command_of(node)):
                yield node.lineno, "a process by one string", "is a shell's line, or soon will be"


def _imported(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Yield the names that imports bind, with what they stand for."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                bound = alias.asname or alias.name.partition(".")[0]
                yield bound, alias.name if alias.asname else bound
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for alias in node.names:
                yield alias.asname or alias.name, f"{node.module}.{alias.name}"


def _modules(node: ast.Import | ast.ImportFrom) -> list[str]:
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if node.level or not node.module:
        return []
    return [f"{node.module}.{alias.name}" for alias in node.names]


def _full_name(node: ast.expr, names: dict[str, str]) -> str:
    if isinstance(node, ast.Name):
        return names.get(node.id, node.id)
    if isinstance(node, ast.Attribute):
        before = _full_name(node.value, names)
        return f"{before}.{node.attr}" if before else ""
    return ""


def _command_of(call: ast.Call) -> ast.expr | None:
    given = next((k.value for k in call.keywords if k.arg == "args"), None)
    return call.args[0] if call.args else given


def _is_text(node: ast.expr | None) -> bool:
    match node:
        case ast.Constant(value=str()) | ast.JoinedStr():
            return True
        case ast.BinOp(left=left, right=right):
            return _is_text(left) or _is_text(right)
        case ast.Call(func=ast.Attribute(attr="join" | "format", value=value)):
            return _is_text(value)
    return False


FILES = sorted(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py"))


def test_all_files_are_looked_at() -> None:
    assert len(FILES) > 300
    for name in ("mav_tasks/shell/runner.py", "sim/rover_sim/body.py", "tools/hatch.py"):
        assert ROOT / name in FILES


def test_no_file_does_what_none_may() -> None:
    found = [
        f"{name}:{line}: {what}: {why}"
        for path in FILES
        for name in [path.relative_to(ROOT).as_posix()]
        for line, what, why in forbidden(path.read_text("utf-8"))
        if (name, what) not in ALLOWED
    ]
    assert found == []


def test_what_is_allowed_is_done_and_has_its_reason() -> None:
    for (name, what), reason in ALLOWED.items():
        does = {each for _, each, _ in forbidden((ROOT / name).read_text("utf-8"))}
        assert what in does, f"{name} does not use {what} any more"
        assert len(reason.split()) > 5


@pytest.mark.parametrize(
    ("source", "what"),
    [
        ("import os\nos.system('ls')", "os.system"),
        ("from os import popen as p\np('ls')", "os.popen"),
        ("import os as o\nrun = o.system", "os.system"),
        ("import subprocess\nsubprocess.run(['ls'], shell=True)", "shell="),
        ("import subprocess\nsubprocess.run(['ls'], shell=maybe)", "shell="),
        ("import subprocess as s\ns.run('ls')", "a process by one string"),
        ("from subprocess import Popen\nPopen(f'ls {x}')", "a process by one string"),
        ("import subprocess\nsubprocess.run('ls ' + x)", "a process by one string"),
        ("import subprocess\nsubprocess.run(args=' '.join(x))", "a process by one string"),
        ("import subprocess\nsubprocess.getoutput('ls')", "subprocess.getoutput"),
        ("import pickle", "pickle"),
        ("from pickle import loads", "pickle"),
        ("def f():\n    import marshal", "marshal"),
        ("import shelve as s", "shelve"),
        ("import numpy\nnumpy.load(f, allow_pickle=True)", "allow_pickle="),
        ("eval('1')", "eval"),
        ("f = exec", "exec"),
        ("import builtins\nbuiltins.eval('1')", "builtins.eval"),
        ("import yaml\nyaml.load(f)", "yaml.load"),
        ("from yaml import unsafe_load\nunsafe_load(f)", "yaml.unsafe_load"),
        ("from tempfile import mktemp\nmktemp()", "tempfile.mktemp"),
        ("import random", "random"),
        ("from random import choice", "random"),
        (
            "import asyncio\nasyncio.create_subprocess_shell('ls')",
            "asyncio.create_subprocess_shell",
        ),
    ],
)
def test_it_can_be_found(source: str, what: str) -> None:
    assert what in {each for _, each, _ in forbidden(source)}


@pytest.mark.parametrize(
    "source",
    [
        "import subprocess\nsubprocess.run(['ls', x], shell=False)",
        "import subprocess\nsubprocess.run(command)",
        "import re\nre.compile('x')",
        "import yaml\nyaml.safe_load(f)",
        "import secrets\nsecrets.token_bytes(32)",
        "from random import SystemRandom",
        "self.eval(1)",
        "model.exec()",
    ],
)
def test_what_is_harmless_is_not_found(source: str) -> None:
    assert list(forbidden(source)) == []
