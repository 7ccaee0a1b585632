"""Profiles of rovers as TOML files, one a rover: ``mav-tasks probe`` writes, serve reads them.

Every value is checked, because a profile changes how a rover is driven.
"""

from pathlib import Path
from typing import Any

from platformdirs import user_config_path

from mav_tasks.basics.errors import ConfigError, SettingError
from mav_tasks.basics.folders import make_private
from mav_tasks.basics.whole_file import replace_whole
from mav_tasks.config import toml_file
from mav_tasks.config.setting_keys.key import declared_in
from mav_tasks.config.setting_keys.literals import literal
from mav_tasks.config.settings import VehicleProfile

NONE = "none"
SUFFIX = ".toml"
MOST_FILES = 1000
MODE = 0o600  # private: a profile identifies a rover and tells its weaknesses

_KEYS = declared_in(VehicleProfile)
_NEEDED = ("system_id", "autopilot", "firmware", "probed")


def usual_folder() -> Path:
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
    found = toml_file.parsed(text, name=name)
    kept: dict[str, Any] = {}
    faults = [f"{name}: {key} is missing" for key in _NEEDED if key not in found.values]
    for key, value in found.values.items():
        where = found.where(key)
        if key not in _KEYS:
            faults.append(f"{where}: {key!a}: a profile has no such key")
            continue
        try:
            kept[key] = _KEYS[key].shape.kept(value)
        except SettingError as error:
            faults.append(f"{where}: {key}: {error}")
    if faults:
        raise ConfigError(*faults)
    return VehicleProfile(**kept)


def text_of(profile: VehicleProfile) -> str:
    """Return a profile as TOML, without unknown values."""
    lines = ["# Profile of a rover, measured by mav-tasks probe; see the key vehicles.profiles."]
    for name, key in _KEYS.items():
        value = getattr(profile, name)
        if value in ("", None, ()) and name not in _NEEDED:
            continue
        line = f"{name} = {literal(key.shape.plain(value))}"
        remark = ", ".join(filter(None, (key.shape.unit, key.meaning)))
        lines.append(f"{line}  # {remark}" if remark else line)
    return "\n".join(lines) + "\n"


def write(profile: VehicleProfile, output: str | None) -> Path:
    """Write a profile to ``output`` or the default folder; raise ConfigError if that fails.

    The file is private, and replaced atomically.
    """
    path = usual_folder() / file_name(profile) if output is None else _expanded(output)
    try:
        if output is None:
            make_private(path.parent)
        replace_whole(path, text_of(profile), mode=MODE)
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    return path


def _expanded(place: str) -> Path:
    try:
        return Path(place).expanduser()
    except RuntimeError as error:
        raise ConfigError(f"vehicles.profiles: {place}: {error}") from error
