"""Reads the configuration again while the server runs; applies live keys, reports the others.

A separate thread reads it: a slow disk must not delay a setpoint.
"""

import asyncio
import logging
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from mav_tasks.basics.errors import ConfigError, SettingError
from mav_tasks.config.configuration import Configuration, Sources
from mav_tasks.config.parameter_table import NAMES
from mav_tasks.config.setting_keys.key import Key, check_bounds
from mav_tasks.config.setting_keys.literals import literal
from mav_tasks.config.settings import BOUNDED, KEYS, ServerSettings, Settings

log = logging.getLogger("mav_tasks")

#: puts the engine's settings into force; returns the parameters that clients have set
Put = Callable[[Settings], Mapping[str, float]]


class Change(NamedTuple):
    """A key with a new value; ``is_taken`` if it is in force without a restart."""

    key: Key
    old: object
    new: object
    is_taken: bool

    def __str__(self) -> str:
        unit = f" {self.key.shape.unit}" if self.key.shape.unit else ""
        words = f"{self.key.name}: {literal(self.old)} -> {literal(self.new)}{unit}"
        return words if self.is_taken else f"{words} needs a restart: still {literal(self.old)}"


class Reload:
    """Reads the same sources again on SIGHUP; used in the loop's thread, except for the reading."""

    def __init__(self, sources: Sources, configuration: Configuration) -> None:
        self._sources = sources
        if configuration.file is not None:  # read the same file, even if it is gone
            self._sources = replace(sources, file=str(configuration.file))
        self._in_force = configuration.settings
        self._is_reading = False
        self._is_asked_again = False
        #: the file that was read at the start
        self.file: Path | None = configuration.file
        #: whether SIGHUP came before the loop ran
        self.was_asked = False

    def note(self, _number: int, _frame: object) -> None:
        """Handle a SIGHUP that comes before the loop runs."""
        self.was_asked = True

    def begin(self, put: Put) -> None:
        """Start to read; then apply live keys with ``put``. Called in the loop."""
        if self._is_reading:
            log.warning("configuration: still reloading; it will be read once more")
            self._is_asked_again = True
            return
        self._is_reading = True
        loop = asyncio.get_running_loop()
        # A daemon thread: a stuck disk must not keep the server from ending.
        threading.Thread(target=self._read, args=(loop, put), daemon=True).start()

    def _read(self, loop: asyncio.AbstractEventLoop, put: Put) -> None:
        outcome: ServerSettings | ConfigError
        try:
            outcome = self._sources.load().settings
        except ConfigError as error:
            outcome = error
        except Exception:  # a bug of ours must not block later reloads
            log.exception("configuration: internal error")
            outcome = ConfigError("it could not be read")
        with suppress(RuntimeError):  # the loop has ended meanwhile
            loop.call_soon_threadsafe(self._has_read, outcome, put)

    def _has_read(self, outcome: ServerSettings | ConfigError, put: Put) -> None:
        self._is_reading = False
        if isinstance(outcome, ConfigError):
            for fault in outcome.faults:
                log.error("configuration: %s", fault)
            log.error("configuration: not applied, the old one stays in force")
        else:
            self._take(outcome, put)
        if self._is_asked_again:
            self._is_asked_again = False
            self.begin(put)

    def _take(self, wanted: ServerSettings, put: Put) -> None:
        before, self._in_force = self._in_force, taken(self._in_force, wanted)
        set_level(self._in_force.log.level)
        has_changed = self._in_force.engine != before.engine
        if self._in_force.engine.profiles != before.engine.profiles:
            count = len(self._in_force.engine.profiles)
            log.info("vehicles.profiles: reloaded, %d in force", count)
        parameters = put(self._in_force.engine) if has_changed else {}
        changes = list(changes_of(before, wanted, in_force=self._in_force))
        for change in changes:
            parameter = NAMES.get(change.key.name, "")
            if not change.is_taken:
                log.warning("%s", change)
            elif parameter in parameters:
                set_to = f"{parameters[parameter]:g}"
                words = "%s, but parameter %s, set by a client, overrides it: %s"
                log.warning(words, change, parameter, set_to)
            else:
                log.info("%s, in force", change)
        if not changes and not has_changed:
            log.info("configuration: reloaded, no changes")


def taken(before: ServerSettings, wanted: ServerSettings) -> ServerSettings:
    """Return the settings ``before`` with the live keys of ``wanted``."""
    settings = before
    for key in KEYS.values():
        if key.is_live:
            settings = key.put(settings, key.of(wanted))
    known = wanted.engine.profiles  # not a key: contents of files that a key names
    settings = replace(settings, engine=replace(settings.engine, profiles=known))
    for key, bound in BOUNDED:  # if a live key now exceeds its bound, both keep their old values
        try:
            check_bounds(settings, key, bound)
        except SettingError:
            for each in (key, bound):
                settings = each.put(settings, each.of(before))
    return settings


def changes_of(
    before: ServerSettings, wanted: ServerSettings, *, in_force: ServerSettings
) -> Iterator[Change]:
    """Yield each key whose wanted value differs from the value before."""
    for key in KEYS.values():
        if key.of(wanted) != key.of(before):
            is_taken = key.of(in_force) == key.of(wanted)
            yield Change(key, key.plain_of(before), key.plain_of(wanted), is_taken)


def set_level(level: str) -> None:
    """Set the lowest level logged: a word of ``log.level``."""
    log.setLevel(level.upper())
