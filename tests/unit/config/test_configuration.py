"""Default, file, environment, flag: each before the one above it."""

from pathlib import Path

import pytest

from mav_tasks.basics.errors import ConfigError
from mav_tasks.config import configuration
from mav_tasks.config.configuration import Configuration, Sources
from mav_tasks.config.sample import sample
from mav_tasks.config.settings import KEYS, ServerSettings
from mav_tasks.config.toml_file import layer_of
from mav_tasks.config.words import VARIABLES, Flag, flag_of_set, variable_of


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's folder for configuration files, empty."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "home"))
    folder = configuration.usual_file().parent
    assert folder.is_relative_to(tmp_path)
    folder.mkdir(parents=True)
    return folder


def load(
    file: str | None = "", environment: dict[str, str] | None = None, *flags: Flag
) -> Configuration:
    return Sources(file, environment or {}, flags).load()


def faults(file: str | None, environment: dict[str, str], *flags: Flag) -> list[str]:
    with pytest.raises(ConfigError) as raised:
        load(file, environment, *flags)
    return list(raised.value.faults)


def test_each_source_comes_before_the_one_above(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    path.write_text(
        "[driving]\nspeed = 0.6\nmax_speed = 3\n[watch]\nstuck = 20\n", encoding="utf-8"
    )
    environment = {"MAV_TASKS_DRIVING_MAX_SPEED": "4", "MAV_TASKS_WATCH_STUCK": "30", "PATH": "x"}
    got = load(
        str(path), environment, flag_of_set("watch.stuck=40"), Flag("--push", "links.push", [])
    )
    assert (got.settings.engine.driving.speed, got.settings.engine.driving.max_speed) == (0.6, 4)
    assert got.settings.engine.watch.stuck == 40
    assert {name: each.where for name, each in got.given.items()} == {
        "driving.speed": f"{path}:2",
        "driving.max_speed": "MAV_TASKS_DRIVING_MAX_SPEED",
        "watch.stuck": "--set watch.stuck",
        "links.push": "--push",
    }
    assert got.file == path


def test_all_faults_of_all_sources_are_told(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    path.write_text("driving.sped = 3\n", encoding="utf-8")
    environment = {"MAV_TASKS_STORE_PATH": "x", "MAV_TASKS_DRIVING_SPEED": "fast"}
    wrong = ("drivng.speed=1", "rules.arming=me", "x", "watch.stuck")
    flags = [flag_of_set(text) for text in wrong]
    assert faults(str(path), environment, *flags) == [
        f"{path}:1: driving.sped: no such key; did you mean driving.speed?",
        "MAV_TASKS_DRIVING_SPEED=fast: not a number: 0.05..10 m/s",
        "MAV_TASKS_STORE_PATH: no such variable; did you mean MAV_TASKS_STORE?",
        "--set drivng.speed: no such key; did you mean driving.speed?",
        "--set rules.arming=me: expected one of auto, server, operator",
        "--set x: no such key",
        "--set watch.stuck: expected watch.stuck=VALUE",
    ]
    (first, *others) = faults(str(path) + "x", environment, *flags)
    assert first == f"{path}x: No such file or directory"
    assert len(others) == 6


def test_a_key_is_said_by_one_flag() -> None:
    twice = (Flag("--arming", "rules.arming", "server"), flag_of_set("rules.arming=operator"))
    assert faults("", {}, *twice) == ["--set rules.arming: rules.arming is already set by --arming"]


def test_every_key_has_a_variable_of_its_own() -> None:
    assert len(VARIABLES) == len(KEYS)
    assert variable_of("driving.turn_rate_deg") == "MAV_TASKS_DRIVING_TURN_RATE_DEG"
    assert variable_of("store.path") == "MAV_TASKS_STORE"


def test_which_file_is_read(home: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.toml"
    other.write_text("driving.speed = 0.7\n", encoding="utf-8")
    variable = {"MAV_TASKS_CONFIG": str(other)}
    assert load(None).file is None
    usual = home / "config.toml"
    usual.write_text("driving.speed = 0.9\n", encoding="utf-8")
    assert load(None).file == usual
    assert load(None).settings.engine.driving.speed == 0.9
    assert load(None, variable).settings.engine.driving.speed == 0.7
    assert load(str(usual), variable).settings.engine.driving.speed == 0.9
    assert load("", variable).file is None
    assert load(None, {"MAV_TASKS_CONFIG": ""}).file is None


def test_the_sample_with_every_key_taken_in_is_the_defaults() -> None:
    lines = sample().splitlines()
    assert all(len(line) <= 100 for line in lines)
    taken_in = "\n".join(line.removeprefix("# ") for line in lines)
    layer = layer_of(taken_in, name="sample")
    assert layer.faults == []
    assert layer.given.keys() == KEYS.keys()
    assert configuration.merged([layer]).settings == ServerSettings()


def test_an_endpoint_that_is_none_is_a_fault() -> None:
    (fault,) = faults("", {"MAV_TASKS_METRICS_LISTEN": "x"})
    assert fault.startswith("MAV_TASKS_METRICS_LISTEN: ")
