"""The configuration read again while the server runs: what can change does, the rest is told.

It is read in a thread of its own: a slow disk must not keep a setpoint.
"""

import asyncio
import logging
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from mav_tasks.config.configuration import Configuration, Sources
from mav_tasks.errors import ConfigError, SettingError
from mav_tasks.services.parameter_table import NAMES
from mav_tasks.setting_keys.key import Key
from mav_tasks.setting_keys.literals import literal
from mav_tasks.setting_keys.table import BOUNDED, KEYS, check_bounds
from mav_tasks.settings import ServerSettings, Settings

log = logging.getLogger("mav_tasks")

#: takes settings of the engine into force; gives what clients have set as parameters
Put = Callable[[Settings], Mapping[str, float]]


class Change(NamedTuple):
    """A key whose value is another one now; ``is_taken`` if that is in force without a restart."""

    key: Key
    old: object
    new: object
    is_taken: bool

    def __str__(self) -> str:
        unit = f" {self.key.shape.unit}" if self.key.shape.unit else ""
        words = f"{self.key.name}: {literal(self.old)} -> {literal(self.new)}{unit}"
        return words if self.is_taken else f"{words} needs a restart: still {literal(self.old)}"


class Reload:
    """Reads the same sources again, on SIGHUP; made and used by one loop, but for the reading."""

    def __init__(self, sources: Sources, configuration: Configuration) -> None:
        self._sources = sources
        if configuration.file is not None:  # the same one again, if it is there or not
            self._sources = Sources(
                str(configuration.file), sources.environment, flags=sources.flags
            )
        self._in_force = configuration.settings
        self._is_reading = False
        self._is_asked_again = False
        #: the file that was read at the start
        self.file: Path | None = configuration.file
        #: SIGHUP has come before there was a loop
        self.was_asked = False

    def note(self, _number: int, _frame: object) -> None:
        """Take SIGHUP before the loop does."""
        self.was_asked = True

    def begin(self, put: Put) -> None:
        """Read, and then take into force what can be; called in the loop."""
        if self._is_reading:
            log.warning("configuration: still being read")
            self._is_asked_again = True
            return
        self._is_reading = True
        loop = asyncio.get_running_loop()
        # A daemon: the server ends, however long the disk takes.
        threading.Thread(target=self._read, args=(loop, put), daemon=True).start()

    def _read(self, loop: asyncio.AbstractEventLoop, put: Put) -> None:
        outcome: ServerSettings | ConfigError
        try:
            outcome = self._sources.load().settings
        except ConfigError as error:
            outcome = error
        except Exception:  # our own mistake must not leave us reading for ever
            log.exception("configuration: internal error")
            outcome = ConfigError("it could not be read")
        with suppress(RuntimeError):  # the loop has ended meanwhile
            loop.call_soon_threadsafe(self._has_read, outcome, put)

    def _has_read(self, outcome: ServerSettings | ConfigError, put: Put) -> None:
        self._is_reading = False
        if isinstance(outcome, ConfigError):
            for fault in outcome.faults:
                log.error("configuration: %s", fault)
            log.error("configuration: nothing changes")
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
            log.info("vehicles.profiles: read again, %d in force", count)
        parameters = put(self._in_force.engine) if has_changed else {}
        changes = list(changes_of(before, wanted, in_force=self._in_force))
        for change in changes:
            parameter = NAMES.get(change.key.name, "")
            if not change.is_taken:
                log.warning("%s", change)
            elif parameter in parameters:
                set_to = f"{parameters[parameter]:g}"
                log.warning("%s, but %s stays as a client set it: %s", change, parameter, set_to)
            else:
                log.info("%s, in force", change)
        if not changes and not has_changed:
            log.info("configuration: read again, nothing has changed")


def taken(before: ServerSettings, wanted: ServerSettings) -> ServerSettings:
    """Return the settings before, with what can change while the server runs as it is wanted."""
    settings = before
    for key in KEYS.values():
        if key.is_live:
            settings = key.put(settings, key.of(wanted))
    known = wanted.engine.profiles  # no key: what the file has that one names
    settings = replace(settings, engine=replace(settings.engine, profiles=known))
    for key, bound in BOUNDED:  # of one that changes and one that does not, both stay
        try:
            check_bounds(settings, key, bound)
        except SettingError:
            for each in (key, bound):
                settings = each.put(settings, each.of(before))
    return settings


def changes_of(
    before: ServerSettings, wanted: ServerSettings, *, in_force: ServerSettings
) -> Iterator[Change]:
    """Yield each key that is wanted otherwise than it was."""
    for key in KEYS.values():
        if key.of(wanted) != key.of(before):
            is_taken = key.of(in_force) == key.of(wanted)
            yield Change(key, key.plain_of(before), key.plain_of(wanted), is_taken)


def set_level(level: str) -> None:
    """Say from now on what is at least of this level: a word of ``log.level``."""
    log.setLevel(level.upper())
