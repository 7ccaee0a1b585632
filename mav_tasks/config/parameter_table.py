"""Which settings of the server are MAVLink parameters, and under what names.

Their units and ranges are those of the configuration's keys. Every one is a REAL32, which is the
same in both encodings that clients use. What decides who may drive (links, arming, what is claimed)
is not among them: a client must not widen its own rights.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from struct import pack, unpack

from mav_tasks.basics.errors import SettingError
from mav_tasks.config.setting_keys.key import ENGINE, Key, value_at, with_value_at
from mav_tasks.config.setting_keys.shapes import Choice, Number
from mav_tasks.config.settings import KEYS, Settings


@dataclass(frozen=True, slots=True)
class Parameter:
    """One setting as a parameter, in the unit of its key.

    Of a setting that is a word, the parameter is its place among the ``choices``.
    """

    name: str
    key: Key
    low: float
    high: float
    is_whole: bool
    choices: tuple[str, ...]

    @property
    def path(self) -> str:
        """Where the engine's settings have it."""
        return self.key.path.removeprefix(ENGINE)

    def value(self, settings: Settings) -> float:
        plain = self.key.shape.plain(value_at(settings, self.path))
        return as_sent(float(self.choices.index(str(plain)) if self.choices else str(plain)))

    def with_value(self, settings: Settings, value: float) -> Settings:
        """Return settings with another value; SettingError names its range."""
        if not self.low <= value <= self.high:  # NaN is neither
            raise SettingError(f"{self.name} {value:g}: not in {self.low:g}..{self.high:g}")
        if self.is_whole and value != int(value):
            raise SettingError(f"{self.name} {value:g}: not a whole number")
        plain = self.choices[int(value)] if self.choices else value
        return with_value_at(settings, self.path, self.key.shape.kept(plain))


def _parameter(name: str, key: Key) -> Parameter:
    match key.shape:
        case Number(low=low, high=high, is_whole=is_whole):
            return Parameter(name, key, low, high, is_whole, choices=())
        case Choice(words=words):
            return Parameter(name, key, 0.0, len(words) - 1.0, is_whole=True, choices=words)
        case shape:
            raise TypeError(f"{name}: {shape} is no parameter")


#: in the order of their indices
PARAMETERS: Mapping[str, Parameter] = {
    name: _parameter(name, key)
    for _, name, key in sorted((*key.parameter, key) for key in KEYS.values() if key.parameter)
}
NAMES: Mapping[str, str] = {each.key.name: name for name, each in PARAMETERS.items()}
#: each parameter that another one bounds, with that other
BOUNDED = tuple(
    (each, PARAMETERS[NAMES[each.key.at_most]]) for each in PARAMETERS.values() if each.key.at_most
)


def changed(settings: Settings, name: str, value: float) -> Settings:
    """Return settings with one parameter changed; SettingError says in words why not.

    ``name`` is one of PARAMETERS.
    """
    new = PARAMETERS[name].with_value(settings, value)
    for each, bound in BOUNDED:
        if name in (each.name, bound.name) and each.value(new) > bound.value(new):
            words = f"{each.name} {each.value(new):g} is more than {bound.name}"
            raise SettingError(f"{words} {bound.value(new):g}")
    return new


def with_all(settings: Settings, values: Mapping[str, float]) -> tuple[Settings, dict[str, str]]:
    """Return settings with parameters that were kept, and by name why some could not be taken.

    Of two that bound each other the bound comes first, if either order does.
    """
    left = {name: value for name, value in values.items() if name in PARAMETERS}
    why_not = {name: f"{name}: there is no such parameter" for name in values.keys() - left.keys()}
    taken = True
    while left and taken:
        taken = False
        for name in list(left):
            try:
                settings = changed(settings, name, left[name])
            except SettingError as error:
                why_not[name] = str(error)
            else:
                taken = True
                del left[name]
                why_not.pop(name, None)
    return settings, why_not


def as_sent(value: float) -> float:
    """Return the number that a person meant, after its way through a float32: 0.1, not 0.100000001.

    What no float32 can hold is left as it is.
    """
    try:
        (single,) = unpack("<f", pack("<f", value))
    except OverflowError:
        return value
    return float(f"{single:.7g}")
