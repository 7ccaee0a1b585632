"""Merges all sources into settings, and remembers for each key which source set it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from platformdirs import user_config_path

from mav_tasks.basics.errors import ConfigError, LinkUrlError, SettingError
from mav_tasks.config import profiles, toml_file, words
from mav_tasks.config.given import Given, Layer, shown
from mav_tasks.config.setting_keys.key import check_bounds
from mav_tasks.config.settings import BOUNDED, ServerSettings
from mav_tasks.links.config_check import faults_of
from mav_tasks.links.endpoint import parse_endpoint

FILE_NAME = "config.toml"


@dataclass(frozen=True, slots=True)
class Configuration:
    """Settings, and the given values by key name; other keys have defaults."""

    settings: ServerSettings
    given: Mapping[str, Given]
    file: Path | None


@dataclass(frozen=True, slots=True)
class Sources:
    """The sources of the configuration; ``load`` can be called more than once.

    ``file``: the requested file; None: the one in the user's folder, if it exists; "": no file.
    """

    file: str | None
    environment: Mapping[str, str]
    flags: Sequence[words.Flag] = ()

    def load(self) -> Configuration:
        """Read all sources; raise ConfigError with all their faults."""
        named = self.environment.get(words.FILE_VARIABLE) if self.file is None else self.file
        path = _chosen_file(named)
        layers = [words.of_environment(self.environment), words.of_flags(self.flags)]
        if path is not None:
            try:
                text = toml_file.read_text(path)
            except ConfigError as error:
                raise ConfigError(*error.faults, *_faults(layers)) from error
            layers.insert(0, toml_file.layer_of(text, name=str(path)))
        configuration = merged(layers, file=path)
        settings = configuration.settings
        if not settings.profiles and named == "":  # no file at all
            return configuration
        engine = replace(settings.engine, profiles=profiles.read(settings.profiles))
        return replace(configuration, settings=replace(settings, engine=engine))


def _chosen_file(named: str | None) -> Path | None:
    """Return the named file, None for "", or without a name the one in the user's folder."""
    if named is not None:
        return Path(named) if named else None
    usual = usual_file()
    try:
        return usual if usual.exists() else None
    except OSError:  # reading the file will report the error
        return usual


def usual_file() -> Path:
    """Return the path of the file in the user's configuration folder."""
    return user_config_path("mav-tasks", appauthor=False) / FILE_NAME


def merged(layers: Sequence[Layer], *, file: Path | None = None) -> Configuration:
    """Return the settings of layers; later layers override. Raise ConfigError with all faults."""
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
    """Yield the faults of valid values that contradict each other."""
    for key, bound in BOUNDED:
        if faulty.isdisjoint((key.name, bound.name)):
            try:
                check_bounds(settings, key, bound)
            except SettingError as error:
                yield f"{_names(key.name, bound.name, given)}: {error}"
    if not any(name.startswith("links.") for name in faulty):
        for field, fault in faults_of(settings.links):
            yield f"{_names(f'links.{field}', '', given)}: {fault}"
    listen = settings.metrics.listen
    if listen:
        try:
            parse_endpoint(listen, what=shown(listen))
        except LinkUrlError as error:
            yield f"{_names('metrics.listen', '', given)}: {error}"


def _names(name: str, other: str, given: Mapping[str, Given]) -> str:
    """Return the place of a key, or, if no source gives it, that of the other key."""
    if name in given:
        return given[name].names()
    return f"{given[other].where}: {name}" if other in given else name
