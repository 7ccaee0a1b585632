"""The table of faults in FAULTS.md names tests that exist: it cannot rot."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parent
FAULTS = (TESTS / "FAULTS.md").read_text(encoding="utf-8")
HEAD = "| fault | what must happen | test |"
NAMED = re.compile(r"`([\w/]+\.py)::(\w+)`")


def rows() -> list[list[str]]:
    """Return the cells of the table, line by line."""
    lines = FAULTS[FAULTS.index(HEAD) :].split("\n\n")[0].splitlines()[2:]
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines]


@cache
def names_in(path: Path) -> frozenset[str]:
    """Return what pytest collects from a file: functions, classes, hypothesis' machines."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Assign):
            found |= {target.id for target in node.targets if isinstance(target, ast.Name)}
    return frozenset(name for name in found if name.lower().startswith("test"))


@pytest.mark.parametrize("row", rows(), ids=lambda row: row[0][:40])
def test_each_fault_has_an_outcome_and_tests_that_exist(row: list[str]) -> None:
    fault, outcome, tests = row
    assert fault
    assert outcome
    named = NAMED.findall(tests)
    assert named
    assert len(named) == len(tests.split("<br>"))  # nothing else is in that cell
    for file, name in named:
        assert (TESTS / file).is_file(), file
        assert name in names_in(TESTS / file), f"{file}::{name}"


#: what the table must speak of, whatever else it does
MUST_BE_THERE = """
SIGKILL · disk is full · slow or stuck · file is removed · client's link flaps · rover's link flaps
reordered · restarts while it is driven · restarts while a task waits
restarts while a task is paused
one system id · ground station fights · second server · 50 m · less than 2 m · position freezes
180° · jumps (compass · another origin · no telemetry · no heartbeats · not a number
clock is frozen · wrongly signed · replayed · revoked · role · floods · changing addresses
bits flipped · wall clock · SIGSTOP · does not stop on HOLD · standard output or error
"""


@pytest.mark.parametrize("words", re.split(r" · |\n", MUST_BE_THERE.strip()))
def test_no_fault_is_left_out(words: str) -> None:
    assert any(words in row[0] for row in rows())
