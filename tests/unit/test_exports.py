"""The public surface, pinned: that it grows is a decision."""

import dataclasses
import inspect
import re
from typing import Any

import pytest

from mav_tasks import errors, settings
from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import Input
from mav_tasks.errors import MavTasksError

KINDS: list[Any] = [kind for _, kind in inspect.getmembers(settings, dataclasses.is_dataclass)]


def public(thing: object) -> list[str]:
    return sorted(name for name in vars(thing) if not name.startswith("_"))


def test_the_engine_has_five_methods_and_a_view() -> None:
    methods = ["handle", "handle_deadline", "next_deadline", "take_events", "take_packets"]
    assert public(Engine) == sorted([*methods, "snapshot"])


def test_the_engine_shows_its_last_words_and_what_it_could_not_take() -> None:
    engine = Engine(settings.Settings(), now=0.0)
    assert public(engine) == ["last_words", "not_in_force"]
    assert (engine.last_words, engine.not_in_force) == ((), ())


def test_time_comes_in_as_a_keyword() -> None:
    for name in ("handle", "handle_deadline", "snapshot"):
        now = inspect.signature(getattr(Engine, name)).parameters["now"]
        assert (now.kind, now.default) == (inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.empty)


def test_what_can_come_into_the_engine() -> None:
    assert [kind.__name__ for kind in Input.__args__] == [
        "Packets",
        "LinkChanged",
        "PeerChanged",
        "Congestion",
        "Committed",
        "StoreFailed",
        "SettingsChanged",
        "WallClock",
        "Shutdown",
    ]


def test_every_setting_is_known_by_name() -> None:
    names = {kind.__name__: [f.name for f in dataclasses.fields(kind)] for kind in KINDS}
    assert names == {
        "Clients": [
            "max_clients",
            "forget_after",
            "push_lost",
            "stream_interval",
            "text_rate",
            "status_rate",
            "priorities",
        ],
        "Driving": [
            "speed",
            "max_speed",
            "turn_rate",
            "max_turn_rate",
            "max_distance",
            "max_turn",
            "max_duration",
            "acceleration",
            "turn_acceleration",
            "arrival_distance",
            "arrival_angle",
            "acceptance_radius",
        ],
        "Identity": ["system_id", "component_id"],
        "Queueing": ["capacity", "quota", "aging", "preemption_gap", "preemption_rest"],
        "Retention": ["max_age", "max_count"],
        "Settings": [
            "identity",
            "driving",
            "watch",
            "queueing",
            "clients",
            "retention",
            "arming",
            "yaw_rate",
            "claim",
            "guided",
            "operator_lost",
            "on_failure",
            "on_restart",
        ],
        "Watch": [
            "setpoint_period",
            "motion_fresh",
            "position_lost",
            "heartbeat_lost",
            "late_tick",
            "start_timeout",
            "ask_vehicle",
            "lost_timeout",
            "fresh_before_resume",
            "stuck",
            "operator_lost",
            "other_controller",
            "commit",
            "forward_answer",
            "shutdown",
            "stop_unconfirmed",
            "still_speed",
            "still_turn_rate",
            "still_time",
        ],
    }


def test_settings_are_frozen() -> None:
    for kind in KINDS:
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(kind(), dataclasses.fields(kind)[0].name, None)


def test_the_tree_of_errors_is_the_one_in_its_docstring() -> None:
    drawing = (errors.__doc__ or "").split("::")[1]
    drawn: dict[str, str] = {}
    path: list[str] = []
    for line in drawing.splitlines():
        found = re.match(r"    ([│├└─ ]*)([A-Z]\w+)", line)
        if found is not None:
            depth = len(found[1]) // 4
            path[depth:] = [found[2]]
            drawn[found[2]] = path[depth - 1] if depth else "Exception"
    kinds: list[Any] = [
        kind
        for _, kind in inspect.getmembers(errors, inspect.isclass)
        if kind.__module__ == errors.__name__
    ]
    assert drawn == {kind.__name__: kind.__base__.__name__ for kind in kinds}
    assert all(issubclass(kind, MavTasksError) for kind in kinds)
