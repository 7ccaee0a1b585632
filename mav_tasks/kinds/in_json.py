"""Goals as JSON, for the HTTP API and agents: ``{"kind": "goto", "north": 4, "east": -2}``."""

from collections.abc import Mapping, Sequence
from typing import Any

from mav_tasks.basics.errors import SettingError
from mav_tasks.config.setting_keys.parts import read_all, shortened
from mav_tasks.kinds import act, drive, goto, move, rotate, wait
from mav_tasks.kinds.form import Form
from mav_tasks.kinds.plugged import plugged

ROTATE, FACE = rotate.FORMS
GOTO, GOTO_GLOBAL, HOME = goto.FORMS
OWN = (move.FORM, ROTATE, drive.FORM, GOTO, GOTO_GLOBAL, FACE, wait.FORM, act.FORM, HOME)
PLUGGED = plugged([form.name for form in OWN])
#: in the order in which they are offered
FORMS = (*OWN, *PLUGGED.forms)
BY_NAME = {form.name: form for form in FORMS}


def goal_schema() -> dict[str, Any]:
    """Return the JSON schema of a goal of any kind."""
    return {"oneOf": [form.schema for form in FORMS]}


def goals_of(values: Sequence[object]) -> list[Any]:
    """Return the goals of a request. Raise SettingError that names the part that is invalid."""
    return [goal for at, value in enumerate(values) for goal in _goals_of(value, f"goals[{at}]")]


def _goals_of(value: object, name: str) -> tuple[Any, ...]:
    if not isinstance(value, Mapping):
        raise SettingError(f"{name}: expected an object, such as {{'kind': 'move', 'distance': 2}}")
    form = BY_NAME.get(value["kind"]) if isinstance(value.get("kind"), str) else None
    if form is None:
        words = f"expected one of {', '.join(BY_NAME)}"
        raise SettingError(f"{name}.kind {shortened(value.get('kind'))}: {words}")
    parts = {part: number for part, number in value.items() if part != "kind"}
    return made_of(form, parts, f"{name}.")


def made_of(form: Form, parts: Mapping[str, object], within: str = "") -> tuple[Any, ...]:
    """Return the goals of a kind with these parts.

    Raise SettingError that names the part, ``within`` the object so named, that is invalid.
    """
    made = form.make(**read_all(form.numbers, parts, within))
    return made if isinstance(made, tuple) else (made,)
