"""One setting: what a field of the settings declares, and the key that follows from it. Pure."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from operator import attrgetter
from typing import Any, TypeVar

from mav_tasks.basics.errors import SettingError
from mav_tasks.config.setting_keys.literals import in_digits
from mav_tasks.config.setting_keys.shapes import Shape

T = TypeVar("T")
ENGINE = "engine."  # where the server's settings have those of the engine
_DECLARED = "setting"  # in the metadata of a field


@dataclass(frozen=True, slots=True)
class Option:
    """An option of ``mav-tasks serve`` for a key: it takes a value, or is a switch that sets one.

    ``sets`` is the plain value of a switch, ``bare`` that of an option without its value; None: the
    option needs one. ``help`` says what the option does; without it the help follows from the key.
    """

    name: str
    metavar: str = ""
    sets: Any = None
    bare: str | None = None
    help: str = ""
    short: str = ""


@dataclass(frozen=True, slots=True)
class Key:
    """A setting with its name in the file, such as ``driving.speed``.

    ``path`` is its place in ServerSettings, such as ``engine.driving.speed``. ``at_most`` names
    another key whose value is this one's upper bound. A key that is not ``is_live`` needs a restart
    to change. ``parameter`` is the index and the name of its MAVLink parameter.
    """

    shape: Shape
    meaning: str
    name: str = ""
    path: str = ""
    is_live: bool = True
    at_most: str = ""
    parameter: tuple[int, str] | None = None
    variable: str = ""
    options: tuple[Option, ...] = ()

    @property
    def table(self) -> str:
        """The table of the file that the key is in."""
        return self.name.partition(".")[0]

    def of(self, settings: object) -> Any:
        """Return the value in the settings' form."""
        return value_at(settings, self.path)

    def plain_of(self, settings: object) -> object:
        """Return the value in the form that people write."""
        return self.shape.plain(self.of(settings))

    def put(self, settings: T, kept: object) -> T:
        """Return a copy of the settings with another value."""
        return with_value_at(settings, self.path, kept)


def setting(
    default: object,
    shape: Shape,
    meaning: str,
    *,
    key: str = "",
    is_live: bool = True,
    at_most: str = "",
    parameter: tuple[int, str] | None = None,
    variable: str = "",
    options: tuple[Option, ...] = (),
) -> Any:
    """Return a field of a dataclass that declares one setting; ``default`` is in kept form.

    All forms of the setting follow from it. ``key`` is its name in the file if that is not its
    path; ``variable`` its environment variable if that does not follow from the name.
    """
    declared = Key(shape, meaning, key, "", is_live, at_most, parameter, variable, options)
    metadata = {_DECLARED: declared}
    if isinstance(default, dict):
        return field(default_factory=default.copy, metadata=metadata)
    return field(default=default, metadata=metadata)


def declared_in(kind: Any) -> Mapping[str, Key]:
    """Return what the fields of a dataclass declare, by field; keys have no path yet."""
    return {each.name: each.metadata[_DECLARED] for each in fields(kind) if each.metadata}


def keys_of(kind: Any, path: str = "") -> Iterator[Key]:
    """Yield the keys of a dataclass of settings, and of those within it, at their paths."""
    declared = declared_in(kind)
    for each in fields(kind):
        place = path + each.name
        if each.name in declared:
            key = declared[each.name]
            yield replace(key, path=place, name=key.name or _name_of(place, key.shape))
        elif is_dataclass(each.default_factory):
            yield from keys_of(each.default_factory, f"{place}.")


def _name_of(path: str, shape: Shape) -> str:
    """Return the name of a key; that of an angle says that it is in degrees."""
    is_angle = shape.unit.partition("/")[0] == "deg"
    return path.removeprefix(ENGINE) + ("_deg" if is_angle else "")


def check_bounds(settings: object, key: Key, bound: Key) -> None:
    """Raise SettingError if a key's value exceeds the value of its bound."""
    if key.of(settings) > bound.of(settings):
        value, most = (in_digits(float(str(k.plain_of(settings)))) for k in (key, bound))
        raise SettingError(f"{value} is more than {bound.name}, {most} {bound.shape.unit}")


def value_at(settings: object, path: str) -> Any:
    """Return the value at a dotted path of field names."""
    return attrgetter(path)(settings)


def with_value_at(settings: T, path: str, kept: object) -> T:
    """Return a copy of the settings with another value at a dotted path."""
    name, _, rest = path.partition(".")
    if rest:
        kept = with_value_at(getattr(settings, name), rest, kept)
    untyped: Any = settings
    changed: T = replace(untyped, **{name: kept})
    return changed
