"""Lines of keys in TOML that is valid and odd."""

import tomllib
from typing import Any

import pytest

from mav_tasks.config.toml_lines import lines_of


def leaves(table: dict[str, Any], before: tuple[str, ...] = ()) -> set[tuple[str, ...]]:
    found = set()
    for name, value in table.items():
        found.add((*before, name))
        if isinstance(value, dict):
            found |= leaves(value, (*before, name))
    return found


@pytest.mark.parametrize(
    ("text", "path", "line"),
    [
        ("a = 1", "a", 1),
        ("\n\n  a=1 # b = 2\nb = 3", "b", 4),
        ("[t]\na = 1\n[u]\na = 2", "u.a", 4),
        ("  [ t . 'u' ]  # [x]\n\ta = 1", "t.u.a", 2),
        ("t.a = 1\nt . b = 2", "t.b", 2),
        ("[t]\nu.a = 1", "t.u.a", 2),
        ('t = {"a" = 1, b = { c = 2 } }', "t.b.c", 1),
        ("x = 0\nt = { a = [1,\n2, {z = 3}], b = 4 }", "t.b", 3),
        ('a = """\nb = 1\n"""\nb = 2', "b", 4),
        ("a = '''\nb = 1\n'''\nb = 2", "b", 4),
        ('a = """x\\"""\nb = 1"""\nb = 2', "b", 3),
        ('a = """x"""""\nb = 2', "b", 2),
        ("a = ''''x'''''\nb = 2", "b", 2),
        ('a = "#"\nb = "[t]"\n[t]\nb = 1', "t.b", 4),
        ('a = ["]",\n  "b = 1", # ]\n  [[1], [2]],\n]\nb = 2', "b", 5),
        ('"a.b" = 1\n"\\u0063" = 2', "c", 2),
        ("a = 1\r\nb = 2\r\n[t]\r\nc = 3\r\n", "t.c", 4),
        ("a = 1979-05-27 07:32:00\nb = 1.5e3\nc = -inf", "c", 3),
        ("[[t]]\na = 1\n[[t]]\na = 2\n[u]\nb = 3", "u.b", 6),
        ("[t]\n[t.u]\n[t.u.v]\na = {}", "t.u.v.a", 4),
        ('[clients]\npriorities = {"255/190" = 7}', "clients.priorities.255/190", 2),
        ('[clients.priorities]\n"255/190@127.0.0.1:1" = 7', "clients.priorities", 1),
    ],
)
def test_a_key_is_found(text: str, path: str, line: int) -> None:
    tomllib.loads(text)
    assert {".".join(path): line for path, line in lines_of(text).items()}[path] == line


def test_every_key_of_an_odd_text_is_found() -> None:
    text = 'a.b.c = 1\n"" = 2\n[\'x y\']\n1.5 = 3\n[q]\nr = {s = {t = []}, "u" = """\n"""}\n'
    found = set(lines_of(text))
    assert found == leaves(tomllib.loads(text))
