"""Profiles of rovers as TOML files, one a rover: ``mav-tasks probe`` writes, serve reads them.

Every value is checked, because a profile changes how a rover is driven.
"""

import os
import tomllib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from platformdirs import user_config_path

from mav_tasks.config import toml_file
from mav_tasks.errors import ConfigError, SettingError
from mav_tasks.folders import make_private
from mav_tasks.setting_keys.literals import literal
from mav_tasks.setting_keys.shapes import HIGHEST_ID, Choice, Number, Shape, Text, Texts
from mav_tasks.settings import Turning, VehicleProfile

NONE = "none"
SUFFIX = ".toml"
MOST_FILES = 1000
MODE = 0o600  # private: a profile identifies a rover and tells its weaknesses

_YES_NO = Choice(("yes", "no"))
_SHAPES: Mapping[str, Shape] = {
    "system_id": Number(1, HIGHEST_ID, is_whole=True),
    "uid": Text("the rover's unique id, in hex"),
    "autopilot": Text("name of the autopilot"),
    "firmware": Text("version of the firmware"),
    "probed": Text("a time, UTC"),
    "yaw_rate": Choice(("honoured", "ignored")),
    "reverse": _YES_NO,
    "turning": Choice(tuple(turning.value for turning in Turning)),
    "turning_radius": Number(0.1, 50, "m"),
    "setpoints": Texts("a list of setpoints"),
    "loss_stop": _YES_NO,
    "setpoint_timeout": Number(0, 60, "s"),
    "speed": Number(0.01, 10, "m/s"),
    "stopping_distance": Number(0, 100, "m"),
    "stopping_time": Number(0, 60, "s"),
}
_NEEDED = ("system_id", "autopilot", "firmware", "probed")
_MEANINGS = {
    "uid": "the profile is used only for this rover",
    "firmware": "and only with this firmware",
    "yaw_rate": "whether it follows yaw rates, also on the spot",
    "reverse": "whether it drives backwards",
    "turning": "whether it turns on the spot, or steers like a car",
    "turning_radius": "m, minimum, if it steers like a car",
    "setpoints": "velocity setpoints that it followed: frame and mask",
    "loss_stop": "whether it stopped by itself when setpoints stopped",
    "setpoint_timeout": "s, from the last setpoint until it slowed down",
    "speed": "m/s, at which the stop was measured",
    "stopping_distance": "m, from the first zero until it stood",
    "stopping_time": "s, from the first zero until it stood",
}


def usual_folder() -> Path:
    """Return the default folder of profiles."""
    return user_config_path("mav-tasks", appauthor=False) / "vehicles"


def file_name(profile: VehicleProfile) -> str:
    """Return the name of a rover's file in a folder."""
    which = f"-{profile.uid[:16]}" if profile.uid.isalnum() else ""
    return f"rover-{profile.system_id}{which}{SUFFIX}"


def read(place: str) -> tuple[VehicleProfile, ...]:
    """Return all profiles of the setting's file or folder; raise ConfigError with all faults."""
    if place == NONE:
        return ()
    if place:
        path = _expanded(place)
    else:
        path = usual_folder()
        try:
            if not path.is_dir():
                return ()
        except OSError:  # a service whose home is closed: this account can have put nothing there
            return ()
    try:
        paths = sorted(path.glob(f"*{SUFFIX}")) if path.is_dir() else [path]
    except OSError as error:
        raise ConfigError(f"vehicles.profiles: {path}: {error.strerror}") from error
    if len(paths) > MOST_FILES:
        raise ConfigError(f"vehicles.profiles: {path}: more than {MOST_FILES} files")
    found: list[VehicleProfile] = []
    faults: list[str] = []
    for each in paths:
        try:
            found.append(profile_of(toml_file.read_text(each), name=str(each)))
        except ConfigError as error:
            faults += error.faults
    if faults:
        raise ConfigError(*faults)
    return tuple(found)


def profile_of(text: str, *, name: str) -> VehicleProfile:
    """Return the profile of a TOML text; raise ConfigError with all faults."""
    try:
        table = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        words = "".join(each if each.isprintable() else "?" for each in str(error))
        raise ConfigError(f"{name}: {words}") from error
    kept: dict[str, Any] = {}
    faults = [f"{name}: {key} is missing" for key in _NEEDED if key not in table]
    for key, value in table.items():
        if key not in _SHAPES:
            faults.append(f"{name}: {key!a}: a profile has no such key")
            continue
        try:
            kept[key] = _SHAPES[key].kept(value)
        except SettingError as error:
            faults.append(f"{name}: {key}: {error}")
    if faults:
        raise ConfigError(*faults)
    return replace(VehicleProfile(), **kept)


def text_of(profile: VehicleProfile) -> str:
    """Return a profile as TOML, without unknown values."""
    lines = ["# Profile of a rover, measured by mav-tasks probe; see the key vehicles.profiles."]
    for field in fields(profile):
        value = getattr(profile, field.name)
        if value in ("", None, ()) and field.name not in _NEEDED:
            continue
        plain = list(value) if isinstance(value, tuple) else value
        line = f"{field.name} = {literal(plain)}"
        meaning = _MEANINGS.get(field.name)
        lines.append(f"{line}  # {meaning}" if meaning else line)
    return "\n".join(lines) + "\n"


def write(profile: VehicleProfile, output: str | None) -> Path:
    """Write a profile to ``output`` or the default folder; raise ConfigError if that fails.

    The file is private, and replaced atomically.
    """
    path = usual_folder() / file_name(profile) if output is None else _expanded(output)
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        if output is None:
            make_private(path.parent)
        fd = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, MODE)
        try:
            with os.fdopen(fd, "w", encoding="utf-8") as file:
                file.write(text_of(profile))
                file.flush()
                os.fsync(file.fileno())
            part.replace(path)
        except BaseException:
            with suppress(OSError):
                part.unlink()
            raise
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    return path


def _expanded(place: str) -> Path:
    try:
        return Path(place).expanduser()
    except RuntimeError as error:
        raise ConfigError(f"vehicles.profiles: {place}: {error}") from error
