"""Every setting declares a key, and its default is a value that it may have."""

import dataclasses
import re
import tomllib
from ast import literal_eval
from collections.abc import Iterator
from math import inf, nan
from typing import Any

import pytest

from mav_tasks.basics.errors import SettingError
from mav_tasks.config.setting_keys.key import check_bounds
from mav_tasks.config.setting_keys.literals import literal
from mav_tasks.config.setting_keys.shapes import (
    ByClient,
    Choice,
    Flag,
    Number,
    Text,
    Texts,
)
from mav_tasks.config.settings import BOUNDED, KEYS, ServerSettings

DEFAULTS = ServerSettings()


def paths_of(settings: Any, before: str = "") -> Iterator[str]:
    for field in dataclasses.fields(settings):
        value = getattr(settings, field.name)
        if dataclasses.is_dataclass(value):
            yield from paths_of(value, f"{before}{field.name}.")
        else:
            yield before + field.name


def test_every_setting_has_exactly_one_key() -> None:
    read_from_a_file = {"engine.profiles"}  # of which vehicles.profiles is the name
    paths = set(paths_of(DEFAULTS)) - read_from_a_file
    assert sorted(key.path for key in KEYS.values()) == sorted(paths)


PRIORITIES = ByClient(Number(0, 10, is_whole=True), example=7)


NO_VALUES: tuple[object, ...] = (nan, inf, -inf, -1, 10**400, None, object(), [1], {"a": []}, b"")
NO_TEXTS = ("nan", "inf", "1e999", "ten", "=", "9" * 5000, "²")


def test_the_default_of_each_key_comes_back_from_how_people_write_it() -> None:
    for key in KEYS.values():
        plain = key.plain_of(DEFAULTS)
        kept = key.shape.kept(plain)
        assert (type(kept), kept) == (type(key.of(DEFAULTS)), key.of(DEFAULTS)), key.name
        assert tomllib.loads(f"x = {literal(plain)}") == {"x": plain}, key.name
        assert key.put(DEFAULTS, kept) == DEFAULTS, key.name


def test_each_key_says_what_it_means_in_one_line() -> None:
    for key in KEYS.values():
        assert key.meaning, key.name
        assert key.shape.valid, key.name
        assert (key.meaning + key.shape.valid).isprintable(), key.name
        assert key.name.replace("_", "").replace(".", "").isalpha(), key.name


def test_what_is_no_value_of_a_key_is_refused_and_never_breaks() -> None:
    for key in KEYS.values():
        for plain in NO_VALUES:
            with pytest.raises(SettingError):
                key.shape.kept(plain)
        if isinstance(key.shape, Number | Choice | Flag | ByClient):
            for text in NO_TEXTS:
                with pytest.raises(SettingError):
                    key.shape.kept(key.shape.read(text))


def test_what_is_wrong_is_said() -> None:
    for shape, plain, says in (
        (Number(0, 1, "days", none="forever"), 2, 'not in 0..1 days, or "forever"'),
        (Flag(), 1, "expected true or false"),
        (Text("a path"), "a\0b", "not a text: a path"),
        (Texts("a list of x"), "x", "not a list of texts: a list of x"),
        (Texts("a list of x", words=("x",)), ["y"], "'y': expected a list of x"),
        (PRIORITIES, {"255/190": 11}, "255/190: not in 0..10, whole"),
        (PRIORITIES, {"0/190": 1}, "'0/190': no client"),
        (PRIORITIES, {"qgc": 1}, "'qgc': no client"),
    ):
        with pytest.raises(SettingError) as raised:
            shape.kept(plain)
        assert str(raised.value).startswith(says)


#: a key and a text => what is kept
TEXTS = """driving.speed=0.8 => 0.8
driving.turn_rate_deg=90 => 1.5707963267948966
queueing.quota=7 => 7
store.keep_days=forever => None
store.keep_days=1 => 86400.0
rules.claim=False => False
rules.guided=now => 'now'
links.push= => ()
links.clients=udpin:127.0.0.1:1, tcp:a:2 => ('udpin:127.0.0.1:1', 'tcp:a:2')
clients.priorities=255/190=7,1/2@h:3=0 => {'255/190': 7, '1/2@h:3': 0}
clients.priorities= => {}"""


def test_a_text_is_read() -> None:
    for name, text, kept in re.findall("(.*?)=(.*) => (.*)", TEXTS):
        shape = KEYS[name].shape
        assert shape.kept(shape.read(text)) == literal_eval(kept)


def test_defaults_keep_their_bounds_and_a_broken_one_is_named() -> None:
    for key, bound in BOUNDED:
        check_bounds(DEFAULTS, key, bound)
        assert key.shape.unit == bound.shape.unit
    faster = KEYS["driving.speed"].put(DEFAULTS, 3.0)
    with pytest.raises(SettingError, match=r"^3 is more than driving\.max_speed, 2 m/s$"):
        check_bounds(faster, KEYS["driving.speed"], KEYS["driving.max_speed"])
