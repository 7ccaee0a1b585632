"""A file gives settings, or all its faults, each by file, line and key."""

import os
import re
from pathlib import Path

import pytest

from mav_tasks.basics.errors import ConfigError
from mav_tasks.config.configuration import Configuration, merged
from mav_tasks.config.settings import ServerSettings
from mav_tasks.config.toml_file import LARGEST, layer_of, read_text


def read(text: str) -> Configuration:
    return merged([layer_of(text, name="c.toml")])


def faults(text: str) -> list[str]:
    with pytest.raises(ConfigError) as raised:
        read(text)
    assert all(fault.isprintable() and len(fault) < 250 for fault in raised.value.faults)
    assert str(raised.value) == "\n".join(raised.value.faults)
    return list(raised.value.faults)


def test_nothing_gives_the_defaults() -> None:
    assert read("").settings == read("[driving]\n[watch]").settings == ServerSettings()


#: a file, ¶ for the end of a line => the beginning of what is said of it, after its name
FAULTS = r"""[driving]¶speed = 50 => 2: driving.speed = 50: not in 0.05..10 m/s
driving.speed = nan => 1: driving.speed = nan: not in 0.05..10 m/s
driving.speed = -inf => 1: driving.speed = -inf: not in 0.05..10 m/s
driving.speed = "1" => 1: driving.speed = 1: not a number: 0.05..10 m/s
driving.speed = true => 1: driving.speed = true: not a number: 0.05..10 m/s
[driving]¶sped = 1 => 2: driving.sped: no such key; did you mean driving.speed?
speed = 1 => 1: speed: no such key; did you mean driving.speed?
"driving.speed" = 1 => 1: "driving.speed": no such key; did you mean driving.speed?
[drivin]¶speed = 1 => 1: drivin: no such table; did you mean driving?
[zzz] => 1: zzz: no such table
a.b.c.d.e.f.g.h.i.j.k = 1 => 1: a: no such table
driving = 1 => 1: driving: expected a table, [driving]
[[driving]]¶speed = 1 => 1: driving: expected a table, [driving]
[driving.speed]¶x = 1 => 1: driving.speed = { "x" = 1 }: not a number: 0.05..10 m/s
[rules]¶arming = 'me' => 2: rules.arming = me: expected one of auto, server, operator
queueing.quota = 1.5 => 1: queueing.quota = 1.5: not a whole number: 1..100000, whole
¶[driving]¶speed = 3 => 3: driving.speed: 3 is more than driving.max_speed, 2 m/s
driving.max_speed = 0.2 => 1: driving.speed: 0.5 is more than driving.max_speed, 0.2 m/s
a = 1¶b =  => 2: Invalid value
a = 1¶a = 2 => 2: Cannot overwrite a value
a = [1,¶2¶¶ => 2: Unclosed array
a = 'x => 1: Expected "'"
x = NINES =>  Exceeds the limit (4300 digits)
queueing.quota = HEX => 1: queueing.quota = a int too large to show
x = NESTED =>  tables or lists are nested too deep
links.vehicles = ['udpin:127.0.0.1'] => 1: links.vehicles: link 'udpin:127.0.0.1': expected
links.push = ['a'] => 1: links.push: push 'a': expected host:port
[links]¶vehicles = ['udpin:0.0.0.0:1'] => 2: links.vehicles: link udpin:0.0.0.0:1 reaches
links.vehicles = ['tcp:127.0.0.1:1', 'tcp:127.0.0.1:1'] => 1: links.vehicles: link tcp:127.0.0.1:1
links.clients = [] => 1: links.clients = []: fewer than 1
xNULy = 1 => 1:
"a\nb" = 1 => 1: "a\nb": no such key"""
LONG = {"NINES": "9" * 5000, "HEX": "0x" + "f" * 9000, "NESTED": "[" * 5000 + "]" * 5000}
LONG |= {"¶": "\n", "NUL": "\0"}


def test_a_fault_is_named_with_its_line() -> None:
    for row in FAULTS.splitlines():
        text, fault = row.split(" => ")
        (only,) = faults(re.sub("|".join(LONG), lambda word: LONG[word[0]], text))
        assert only.startswith(f"c.toml:{fault}")


def test_all_faults_are_told_at_once() -> None:
    text = "[driving]\nspeed = 0\nsped = 1\n[watch]\nstuck = 'x'\n[zoo]\n"
    text += "[links]\npush = ['x', 'y:0']\n"
    assert [fault.partition(": ")[0] for fault in faults(text)] == [
        *("c.toml:2", "c.toml:3", "c.toml:5", "c.toml:6"),
        *("c.toml:8", "c.toml:8"),
    ]


def test_a_value_that_is_none_breaks_no_bound() -> None:
    assert len(faults("driving.max_speed = 0.2\ndriving.speed = 99")) == 1


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "bytes").write_bytes(b"a = 1\n\xff")
    (tmp_path / "large").write_bytes(b"#" * (LARGEST + 1))
    for name, says in (
        ("none", "No such file"),
        ("folder", "not a file"),
        ("pipe", "not a file"),
        ("bytes", ":2: not UTF-8"),
        ("large", "larger than 256 kB"),
    ):
        with pytest.raises(ConfigError, match=says) as raised:
            read_text(tmp_path / name)
        assert str(raised.value).startswith(str(tmp_path / name))


def test_the_lines_of_keys_are_found_in_odd_texts() -> None:
    for text, line in (
        ("\n\n  driving.speed=1 # b = 2", 3),
        ("  [ driving ]  # [x]\n\tspeed = 1", 2),
        ("driving.acceleration = 1\ndriving . speed = 1", 2),
        ('driving = {"speed" = 1, acceleration = 1}', 1),
        ('store.path = """\n[driving]\nspeed = 3\n"""\n[driving]\n"speed" = 1', 6),
        ("log.level = 'info'\r\n[driving]\r\nspeed = 1\r\n", 3),
        ('links.push = ["127.0.0.1:1",\n  "127.0.0.1:2", # ]\n]\ndriving.speed = 1', 4),
    ):
        assert read(text).given["driving.speed"].where == f"c.toml:{line}", text


def test_a_key_of_very_many_parts_costs_nothing() -> None:
    """``tomllib`` would want 40 GB for it, while a rover drives: SIGHUP reads files, too."""
    for key in ["a" + ".a" * 100_000, "'a'" + ' . "a"' * 40_000]:
        for text in ["{} = 1", "[{}]", "[driving]\nspeed = 1\n{} = 1", "x = {{{} = 1}}"]:
            (fault,) = faults(text.format(key))
            assert fault == f"c.toml:{text.count(chr(10)) + 1}: a key with too many parts"


def test_of_very_many_faults_only_some_are_told() -> None:
    """Each is a line of the log when the file is read again, and looked at by the loop."""
    said = faults("".join(f"[t{number}]\n" for number in range(20_000)))
    assert len(said) < 100
    assert said[-1] == "c.toml: there are more errors"
