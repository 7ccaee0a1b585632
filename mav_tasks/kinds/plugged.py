"""Kinds of tasks from other packages: entry points in the group ``mav_tasks.kinds``.

Each names a ``Form``, whose ``make`` returns a goal of ours, or several to be driven in order. So
others decide what a task consists of, but code of others is never in the server that drives and
stops a rover, and a stored task needs no plug-in to be read.
"""

from collections.abc import Callable, Collection
from dataclasses import replace
from importlib.metadata import entry_points
from keyword import iskeyword
from typing import Any, NamedTuple

from mav_tasks.basics.errors import SettingError
from mav_tasks.config.setting_keys.parts import Part
from mav_tasks.kinds.base import Base
from mav_tasks.kinds.form import Form

GROUP = "mav_tasks.kinds"
#: names that each submission has on the command line, and on the page
TAKEN = (
    *("priority", "after", "before", "delay", "at", "deadline", "label", "every", "cron", "nonce"),
    *("preemptible", "preemptive", "wait", "server", "vehicle", "timeout", "sign", "keys", "json"),
    *("kind", "rover", "help", "terms", "options", "common"),
)


class Plugged(NamedTuple):
    """The kinds of other packages, and which are broken, in words; "" for none."""

    forms: tuple[Form, ...]
    broken: str


def plugged(known: Collection[str]) -> Plugged:
    """Return the kinds of the packages that are installed; ``known`` are the names of ours."""
    forms: dict[str, Form] = {}
    broken: list[str] = []
    for entry in sorted(entry_points(group=GROUP), key=lambda each: (each.name, each.value)):
        try:
            form = entry.load()
            if why := _wrong_with(form, [*known, *forms]):
                raise SettingError(why)
            forms[form.name] = replace(form, make=_checked(form))
        except Exception as error:  # noqa: BLE001 - of another package: we go on without it
            why = str(error) if isinstance(error, SettingError) else repr(error)
            broken.append(f"kind of task {entry.name} ({entry.value}) is left out: {why}")
    return Plugged(tuple(forms.values()), "; ".join(broken))


def _wrong_with(form: object, known: Collection[str]) -> str:
    """Return what is wrong with a kind, or ""."""
    if not isinstance(form, Form):
        return f"expected a Form, not {type(form).__name__}"
    names = [part.name for part in form.numbers if isinstance(part, Part)]
    if len(names) < len(form.numbers) or len(set(names)) < len(names):
        return "its numbers are not Parts with names of their own"
    for name in (form.name, *names):
        is_name = name.isascii() and name.isidentifier() and name.islower()
        if not is_name or iskeyword(name):
            return f"name {name!r}: expected lower case letters, digits and underscores"
    if form.name in known:
        return f"there is a kind {form.name} already"
    taken = [name for name in names if name in TAKEN]
    return f"{', '.join(taken)}: an option of each task has this name" if taken else ""


def _checked(form: Form) -> Callable[..., tuple[Base, ...]]:
    """Return ``make`` of a kind, which raises SettingError unless it makes goals."""

    def make(**kept: Any) -> tuple[Base, ...]:
        try:
            made = form.make(**kept)
        except Exception as error:
            why = str(error) if isinstance(error, ValueError) else repr(error)
            raise SettingError(f"{form.name}: {why}") from error
        goals = made if isinstance(made, tuple) else (made,)
        if not goals or not all(isinstance(goal, Base) for goal in goals):
            raise SettingError(f"{form.name} made no goals, but {made!r}")
        return goals

    return make
