"""Profiles of rovers: written whole and for nobody else to read; read, and checked."""

from dataclasses import replace
from pathlib import Path

import pytest

from mav_tasks.basics.errors import ConfigError
from mav_tasks.config import profiles
from mav_tasks.config.configuration import Sources
from mav_tasks.config.settings import VehicleProfile

FULL = VehicleProfile(
    system_id=7,
    uid="3c0031",
    autopilot="px4",
    firmware='1.15.4 "99c4"',
    probed="2026-11-21T10:00:00Z",
    yaw_rate="honoured",
    reverse="yes",
    turning="steered",
    turning_radius=1.25,
    setpoints=("BODY_NED 0x05C7", "LOCAL_NED 0x0DC7"),
    loss_stop="yes",
    setpoint_timeout=1.13,
    speed=0.298,
    stopping_distance=0.085,
    stopping_time=0.36,
)
LEAST = VehicleProfile(system_id=1, autopilot="px4", firmware="1.0.0", probed="2026-11-21")

TOO_LONG = f"/{300 * 'x'}"


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's folder of profiles, which is not there yet."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "home"))
    folder = profiles.usual_folder()
    assert folder.is_relative_to(tmp_path)
    return folder


def faults_of(text: str) -> tuple[str, ...]:
    with pytest.raises(ConfigError) as raised:
        profiles.profile_of(text, name="p.toml")
    return raised.value.faults


def test_what_was_written_is_read(home: Path) -> None:
    for profile in [FULL, LEAST]:
        path = profiles.write(profile, None)
        assert path.parent == home
        assert path.stat().st_mode & 0o777 == 0o600
        assert profiles.read("") == (profile,)
        assert list(home.iterdir()) == [path]
        path.unlink()


def test_each_rover_has_a_file_and_the_last_one_counts(home: Path) -> None:
    profiles.write(FULL, None)
    profiles.write(replace(FULL, uid="another"), None)
    again = replace(FULL, yaw_rate="ignored")
    profiles.write(again, None)
    assert set(profiles.read(str(home))) == {again, replace(FULL, uid="another")}


NEEDED = 'system_id = 1\nautopilot = "px4"\nfirmware = "1"\nprobed = "2026"\n'


#: a line after those => what is said of it
FAULTS = """yaw = 1 => 'yaw': a profile has no such key
yaw_rate = "perhaps" => yaw_rate: expected one of honoured, ignored
stopping_distance = nan => stopping_distance: not in 0..100 m
speed = 0 => speed: not in 0.01..10 m/s
setpoints = 1 => setpoints: not a list of texts: a list of setpoints"""


def test_each_fault_of_a_file_is_named() -> None:
    for row in FAULTS.splitlines():
        line, fault = row.split(" => ")
        assert faults_of(NEEDED + line) == (f"p.toml:5: {fault}",)
    missing = ("system_id", "autopilot", "firmware", "probed")
    assert faults_of("") == tuple(f"p.toml: {name} is missing" for name in missing)
    assert faults_of(NEEDED.replace("= 1\n", "= 256\n")) == (
        "p.toml:1: system_id: not in 1..255, whole",
    )
    (fault,) = faults_of("system_id = ")
    assert fault.startswith("p.toml:1: Invalid value")


def test_the_server_has_them_with_its_settings(tmp_path: Path, home: Path) -> None:
    assert Sources("", {}).load().settings.engine.profiles == ()
    profiles.write(FULL, None)
    profiles.write(LEAST, str(tmp_path / "p.toml"))
    assert Sources(None, {}).load().settings.engine.profiles == (FULL,)
    assert Sources("", {}).load().settings.engine.profiles == (), "no file at all"
    assert Sources(None, {"MAV_TASKS_CONFIG": ""}).load().settings.engine.profiles == ()
    named = {"MAV_TASKS_VEHICLES_PROFILES": str(tmp_path / "p.toml")}
    assert Sources("", named).load().settings.engine.profiles == (LEAST,)
    named = {"MAV_TASKS_VEHICLES_PROFILES": "none"}
    assert Sources(None, named).load().settings.engine.profiles == ()


def test_what_cannot_be_read_or_written_says_why(
    home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "bad.toml").write_text("system_id = 1", encoding="utf-8")
    home.mkdir(parents=True)
    for number in range(1001):
        (home / f"{number}.toml").touch()
    for place, words in [
        (TOO_LONG, "File name too long"),
        (str(tmp_path), "bad.toml: autopilot is missing"),
        ("~nobody-at-all/p", "home directory"),
        ("", "more than 1000 files"),
    ]:
        with pytest.raises(ConfigError, match=words):
            profiles.read(place)
    monkeypatch.setenv("XDG_CONFIG_HOME", TOO_LONG)
    assert profiles.read("") == ()
    for output in (TOO_LONG, None):
        with pytest.raises(ConfigError, match="File name too long"):
            profiles.write(LEAST, output)
    with pytest.raises(ConfigError, match="File name too long"):
        Sources(None, {}).load()
