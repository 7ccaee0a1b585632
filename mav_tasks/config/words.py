"""Reads environment variables and command-line flags as values for keys."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mav_tasks.config.given import Layer, Source, shown, suggestion
from mav_tasks.config.settings import KEYS

PREFIX = "MAV_TASKS_"
FILE_VARIABLE = "MAV_TASKS_CONFIG"  # the configuration file; "" for none
SERVER_VARIABLE = "MAV_TASKS_SERVER"  # the server that client commands address
SIGN_VARIABLE = "MAV_TASKS_SIGN"  # the key with which client commands sign
#: variables that set no key
OTHERS = (FILE_VARIABLE, SERVER_VARIABLE, SIGN_VARIABLE)


def variable_of(name: str) -> str:
    return KEYS[name].variable or PREFIX + name.upper().replace(".", "_")


VARIABLES: Mapping[str, str] = {variable_of(name): name for name in KEYS}


@dataclass(frozen=True, slots=True)
class Flag:
    """One flag of a command, or ``--set``: a text or a plain value for a named key."""

    where: str
    name: str
    value: object


def of_environment(environment: Mapping[str, str]) -> Layer:
    layer = Layer(Source.ENVIRONMENT)
    for variable in sorted(environment):
        if variable in OTHERS or not variable.startswith(PREFIX):
            continue
        if variable in VARIABLES:
            layer.read(KEYS[VARIABLES[variable]], environment[variable], variable)
        else:
            near = suggestion(variable, VARIABLES)
            layer.faults.append(f"{shown(variable)}: no such variable{near}")
    return layer


def of_flags(flags: Sequence[Flag]) -> Layer:
    """Return the layer of the flags; two flags for one key are a fault."""
    layer = Layer(Source.FLAG)
    for flag in flags:
        key = KEYS.get(flag.name)
        if key is None:
            near = suggestion(flag.name, KEYS)
            layer.faults.append(f"{shown(flag.where)}: no such key{near}")
        elif key.name in layer.given:
            before = layer.given[key.name].where
            layer.refuse(key, f"{flag.where}: {key.name} is already set by {before}")
        elif flag.value is None:
            layer.refuse(key, f"{flag.where}: expected {key.name}=VALUE")
        elif isinstance(flag.value, str):
            layer.read(key, flag.value, flag.where)
        else:
            layer.take(key, flag.value, flag.where)
    return layer


def flag_of_set(text: str) -> Flag:
    """Return the flag for ``--set KEY=VALUE``; its value is None if "=" is missing."""
    name, equals, value = text.partition("=")
    return Flag(f"--set {name.strip()}", name.strip(), value.strip() if equals else None)
