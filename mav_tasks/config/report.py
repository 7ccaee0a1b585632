"""Reports the values in force with their sources: as TOML for people, as JSON for scripts."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from mav_tasks.basics.errors import UsageError
from mav_tasks.config.configuration import Configuration
from mav_tasks.config.given import Source, suggestion
from mav_tasks.config.parameter_table import NAMES, with_all
from mav_tasks.config.setting_keys.literals import literal
from mav_tasks.config.settings import KEYS, TABLES


def chosen(names: Sequence[str]) -> list[str]:
    """Return the named keys, and all keys of a named table; without names, all keys.

    Raise UsageError for an unknown name.
    """
    found: list[str] = []
    for name in names:
        if name in TABLES:
            found += [key.name for key in KEYS.values() if key.table == name]
        elif name in KEYS:
            found.append(name)
        else:
            raise UsageError(f"{name}: no such key{suggestion(name, [*KEYS, *TABLES])}")
    return found or list(KEYS)


@dataclass(frozen=True, slots=True)
class Entry:
    """One key: plain value, unit, and source."""

    key: str
    value: object
    unit: str
    source: Source
    where: str


class Report:
    """The configuration, overridden by the MAVLink parameters that clients have set."""

    def __init__(self, configuration: Configuration, parameters: Mapping[str, float]) -> None:
        self._configuration = configuration
        self._parameters = parameters
        engine, why_not = with_all(configuration.settings.engine, parameters)
        self._in_force = replace(configuration.settings, engine=engine)
        self._why_not = why_not
        #: a text for each parameter without effect
        self.not_in_force = tuple(why for _, why in sorted(why_not.items()))

    def entry(self, name: str) -> Entry:
        key, given = KEYS[name], self._configuration.given.get(name)
        parameter = NAMES.get(name, "")
        value = key.plain_of(self._in_force)
        if parameter in self._parameters and parameter not in self._why_not:
            return Entry(name, value, key.shape.unit, Source.PARAMETER, parameter)
        if given is None:
            return Entry(name, value, key.shape.unit, Source.DEFAULT, "")
        return Entry(name, value, key.shape.unit, given.source, given.where)

    def as_toml(self, names: Iterable[str]) -> str:
        """Return a line for each key; the text is a valid configuration file."""
        entries = [self.entry(name) for name in names]
        lines = [f"{entry.key} = {literal(entry.value)}" for entry in entries]
        width = min(max(map(len, lines)), 48)
        return "".join(
            f"{line:{width}}  # {_remark(entry)}\n"
            for line, entry in zip(lines, entries, strict=True)
        )

    def as_json(self, names: Iterable[str]) -> str:
        """Return a JSON object with the file that was read, and each key."""
        file = self._configuration.file
        told = {
            "file": None if file is None else str(file),
            "keys": {
                entry.key: {
                    "value": entry.value,
                    "unit": entry.unit,
                    "source": entry.source.value,
                    "where": entry.where,
                    "live": KEYS[entry.key].is_live,
                }
                for entry in map(self.entry, names)
            },
            "not_in_force": list(self.not_in_force),
        }
        return json.dumps(told, indent=2, ensure_ascii=False) + "\n"


def _remark(entry: Entry) -> str:
    where = entry.where or entry.source.value
    if entry.source is Source.PARAMETER:
        where = f"{entry.where}, set by a client"
    return f"{entry.unit}, {where}" if entry.unit else where
