"""One key of the configuration, and the setting that it fills. Pure."""

from dataclasses import dataclass, replace
from typing import Any, TypeVar

from mav_tasks.setting_keys.shapes import Shape
from mav_tasks.settings import ServerSettings

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Key:
    """A setting with its name in the file, such as ``driving.speed``.

    ``path`` is its place in ServerSettings, such as ``engine.driving.speed``. ``at_most`` names
    another key whose value is this one's upper bound. A key that is not ``is_live`` needs a restart
    to change.
    """

    name: str
    path: str
    shape: Shape
    meaning: str
    is_live: bool = True
    at_most: str = ""

    def of(self, settings: ServerSettings) -> Any:
        """Return the value in the settings' form."""
        return value_at(settings, self.path)

    def plain_of(self, settings: ServerSettings) -> object:
        """Return the value in the form that people write."""
        return self.shape.plain(self.of(settings))

    def put(self, settings: ServerSettings, kept: object) -> ServerSettings:
        """Return a copy of the settings with another value."""
        return with_value_at(settings, self.path, kept)


def value_at(settings: object, path: str) -> Any:
    """Return the value at a dotted path of field names."""
    for name in path.split("."):
        settings = getattr(settings, name)
    return settings


def with_value_at(settings: T, path: str, kept: object) -> T:
    """Return a copy of the settings with another value at a dotted path."""
    name, _, rest = path.partition(".")
    if rest:
        kept = with_value_at(getattr(settings, name), rest, kept)
    untyped: Any = settings
    changed: T = replace(untyped, **{name: kept})
    return changed
