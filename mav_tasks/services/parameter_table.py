"""Which settings of the server are MAVLink parameters, under what names, in what units and ranges.

Every one is a REAL32, which is the same in both encodings that clients use. What decides who may
drive (links, arming, what is claimed) is not among them: a client must not widen its own rights.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi
from struct import pack, unpack
from typing import Any

from mav_tasks.errors import SettingError
from mav_tasks.settings import Settings

DEGREE = pi / 180
PAUSE_OR_CONTINUE = ("pause", "continue")


@dataclass(frozen=True, slots=True)
class Parameter:
    """One setting as a parameter: ``low`` to ``high``, each of which is ``unit`` in the setting.

    ``part`` is the group of settings, "" for one of the server's own. With ``choices`` the setting
    is a word, and the parameter its place among them; ``at_most`` names another that bounds it.
    """

    name: str
    part: str
    field: str
    low: float = 0.0
    high: float = 0.0
    unit: float = 1.0
    is_whole: bool = False
    choices: tuple[str, ...] = ()
    at_most: str = ""

    def value(self, settings: Settings) -> float:
        """Give the value that settings have."""
        kept: Any = getattr(getattr(settings, self.part) if self.part else settings, self.field)
        return float(self.choices.index(kept)) if self.choices else as_sent(kept / self.unit)

    def with_value(self, settings: Settings, value: float) -> Settings:
        """Give settings with another value; SettingError names its range."""
        kept = self._kept(value)
        if not self.part:
            return replace(settings, **{self.field: kept})
        changed: Any = replace(getattr(settings, self.part), **{self.field: kept})
        return replace(settings, **{self.part: changed})

    def _kept(self, value: float) -> Any:
        high = len(self.choices) - 1.0 if self.choices else self.high
        if not self.low <= value <= high:  # NaN is neither
            raise SettingError(f"{self.name} {value:g}: not in {self.low:g}..{high:g}")
        if not self.choices and not self.is_whole:
            return value * self.unit
        if value != int(value):
            raise SettingError(f"{self.name} {value:g}: not a whole number")
        return self.choices[int(value)] if self.choices else int(value)


PARAMETERS: Mapping[str, Parameter] = {
    each.name: each
    for each in (
        Parameter("TSK_SPEED", "driving", "speed", 0.05, 10.0, at_most="TSK_SPEED_MAX"),
        Parameter("TSK_SPEED_MAX", "driving", "max_speed", 0.05, 10.0),
        Parameter("TSK_TURN", "driving", "turn_rate", 1.0, 360.0, DEGREE, at_most="TSK_TURN_MAX"),
        Parameter("TSK_TURN_MAX", "driving", "max_turn_rate", 1.0, 360.0, DEGREE),
        Parameter("TSK_ACCEL", "driving", "acceleration", 0.05, 5.0),
        Parameter("TSK_ACC_RAD", "driving", "acceptance_radius", 0.05, 100.0),
        Parameter("TSK_DIST_MAX", "driving", "max_distance", 1.0, 1e6),
        Parameter("TSK_QUEUE_MAX", "queueing", "capacity", 1.0, 1e5, is_whole=True),
        Parameter("TSK_QUOTA", "queueing", "quota", 1.0, 1e5, is_whole=True),
        Parameter("TSK_PREEMPT", "queueing", "preemption_gap", 0.0, 10.0, is_whole=True),
        Parameter("TSK_PREEMPT_S", "queueing", "preemption_rest", 0.0, 3600.0),
        Parameter("TSK_START_TMO", "watch", "start_timeout", 3.0, 120.0),
        Parameter("TSK_STUCK_TMO", "watch", "stuck", 2.0, 600.0),
        Parameter("TSK_LOST_TMO", "watch", "lost_timeout", 3.0, 3600.0),
        Parameter("TSK_OPER_TMO", "watch", "operator_lost", 2.0, 600.0),
        Parameter("TSK_ON_OPLOST", "", "operator_lost", choices=("continue", "pause")),
        Parameter("TSK_ON_FAIL", "", "on_failure", choices=PAUSE_OR_CONTINUE),
        Parameter("TSK_ON_RESTART", "", "on_restart", choices=PAUSE_OR_CONTINUE),
        Parameter("TSK_GUIDED", "", "guided", choices=("queue", "now")),
    )
}


def changed(settings: Settings, name: str, value: float) -> Settings:
    """Give settings with one parameter changed; SettingError says in words why not.

    ``name`` is one of PARAMETERS.
    """
    new = PARAMETERS[name].with_value(settings, value)
    for each in PARAMETERS.values():
        if each.at_most and name in (each.name, each.at_most):
            bound = PARAMETERS[each.at_most]
            if each.value(new) > bound.value(new):
                words = f"{each.name} {each.value(new):g} is more than {bound.name}"
                raise SettingError(f"{words} {bound.value(new):g}")
    return new


def with_all(settings: Settings, values: Mapping[str, float]) -> tuple[Settings, dict[str, str]]:
    """Give settings with parameters that were kept, and by name why some could not be taken.

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
    """Give the number that a person meant, after its way through a float32: 0.1, not 0.100000001.

    What no float32 can hold is left as it is.
    """
    try:
        (single,) = unpack("<f", pack("<f", value))
    except OverflowError:
        return value
    return float(f"{single:.7g}")
