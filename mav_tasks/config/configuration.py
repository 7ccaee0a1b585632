"""All sources together: settings, and for each key who said its value."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from platformdirs import user_config_path

from mav_tasks.config import profiles, toml_file, words
from mav_tasks.config.given import Given, Layer
from mav_tasks.errors import ConfigError, SettingError
from mav_tasks.links.config_check import faults_of
from mav_tasks.setting_keys.table import BOUNDED, check_bounds
from mav_tasks.settings import ServerSettings

FILE_NAME = "config.toml"


@dataclass(frozen=True, slots=True)
class Configuration:
    """Settings, and by the key's name what was given; what was not is as by default."""

    settings: ServerSettings
    given: Mapping[str, Given]
    file: Path | None


@dataclass(frozen=True, slots=True)
class Sources:
    """Where the configuration comes from; it can be read more than once.

    ``file`` is what was asked for: None for the one in the user's folder if there is one, "" for
    none at all.
    """

    file: str | None
    environment: Mapping[str, str]
    flags: Sequence[words.Flag] = ()

    def load(self) -> Configuration:
        """Read them all; ConfigError has every fault of all of them."""
        path = chosen_file(self.file, self.environment)
        layers = [words.of_environment(self.environment), words.of_flags(self.flags)]
        if path is not None:
            try:
                text = toml_file.read_text(path)
            except ConfigError as error:
                raise ConfigError(*error.faults, *_faults(layers)) from error
            layers.insert(0, toml_file.layer_of(text, name=str(path)))
        configuration = merged(layers, file=path)
        settings = configuration.settings
        if not settings.profiles and names_no_file(self.file, self.environment):
            return configuration
        engine = replace(settings.engine, profiles=profiles.read(settings.profiles))
        return replace(configuration, settings=replace(settings, engine=engine))


def names_no_file(asked: str | None, environment: Mapping[str, str]) -> bool:
    """Whether nothing of the user's folder is to be read."""
    return _named(asked, environment) == ""


def _named(asked: str | None, environment: Mapping[str, str]) -> str | None:
    return asked if asked is not None else environment.get(words.FILE_VARIABLE)


def chosen_file(asked: str | None, environment: Mapping[str, str]) -> Path | None:
    """Return the file to read: the one asked for, that of the environment, the user's; or None."""
    named = _named(asked, environment)
    if named is not None:
        return Path(named) if named else None
    usual = usual_file()
    try:
        return usual if usual.exists() else None
    except OSError:  # it cannot be looked at: reading it says why
        return usual


def usual_file() -> Path:
    """Return where the user's own file is, if there is one."""
    return user_config_path("mav-tasks", appauthor=False) / FILE_NAME


def merged(layers: Sequence[Layer], *, file: Path | None = None) -> Configuration:
    """Return settings of layers, the later before the earlier; ConfigError has all their faults."""
    given: dict[str, Given] = {}
    for layer in layers:
        given |= layer.given
    settings = ServerSettings()
    for each in given.values():
        settings = each.key.put(settings, each.kept)
    faulty = frozenset[str]().union(*(layer.faulty for layer in layers))
    faults = [*_faults(layers), *_faults_together(settings, given, faulty)]
    if faults:
        raise ConfigError(*faults)
    return Configuration(settings, given, file)


def _faults(layers: Sequence[Layer]) -> list[str]:
    return [fault for layer in layers for fault in layer.faults]


def _faults_together(
    settings: ServerSettings, given: Mapping[str, Given], faulty: frozenset[str]
) -> Iterator[str]:
    """What is wrong with values that are good each for itself."""
    for key, bound in BOUNDED:
        if faulty.isdisjoint((key.name, bound.name)):
            try:
                check_bounds(settings, key, bound)
            except SettingError as error:
                yield f"{_names(key.name, bound.name, given)}: {error}"
    if not any(name.startswith("links.") for name in faulty):
        for field, fault in faults_of(settings.links):
            yield f"{_names(f'links.{field}', '', given)}: {fault}"


def _names(name: str, other: str, given: Mapping[str, Given]) -> str:
    """Return where a key stands; if it does not, where the other one does."""
    if name in given:
        return given[name].names()
    return f"{given[other].where}: {name}" if other in given else name
