"""The reference pages of the site, in Markdown, made from the code: see ``PAGES``."""

import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import groupby
from pathlib import Path
from typing import Any

from typer.main import get_command

import mav_tasks
from mav_tasks.cli.app import app
from mav_tasks.cli.lazy import LazyCommand
from mav_tasks.cli.program import Program
from mav_tasks.client.aio import Client
from mav_tasks.config.key_ring.watch import RingWatch
from mav_tasks.config.setting_keys.key import Key
from mav_tasks.config.setting_keys.literals import in_digits, literal
from mav_tasks.config.settings import KEYS, ServerSettings
from mav_tasks.tasks.lifecycle import TaskReason, words_of
from mav_tasks.web.application import operations_of
from mav_tasks.web.live import Live
from mav_tasks.web.openapi import document_of
from mav_tasks.web.operation import ROOT as API
from mav_tasks.web.services import Services
from mav_tasks.web.sessions import Sessions
from mav_tasks.web.users import Users

sys.path.append(str(Path(__file__).resolve().parents[1]))  # the folder of the tools

import policy_table

Schema = Mapping[str, Any]
FIELDS = "name, type, meaning, required"
#: titles of what is exported, by the modules that it is from
GROUPS = {
    "mav_tasks": "Clients, keys, plans",
    "mav_tasks.kinds": "Kinds of tasks",
    "mav_tasks.client.values": "Statuses",
    "mav_tasks.tasks": "States and reasons",
    "mav_tasks.basics.errors": "Errors",
}
TERMS = ("CommonTerms", "Terms", "Changes")
#: shown without members: the blocking client has those of the other one, kinds have inner ones
#: only, and reasons get a table
BRIEF = ("SyncClient", "SyncTask", "TaskReason", *TERMS)
OF_SETTINGS = """\
`mav-tasks config init` prints them as a file. The server applies a change on SIGHUP, but that of a
setting marked *restart* needs one. Clients can set what has a parameter."""
OF_HTTP = f"""\
All paths are below `{API}`; `{API}/openapi.json` is this page for programs (OpenAPI). An answer
that is no success is a [Problem](#problem)."""


def library() -> str:
    """Return the page of what ``mav_tasks`` exports; mkdocstrings fills it in."""
    homes = [(_home_of(getattr(mav_tasks, name)), name) for name in mav_tasks.__all__]
    parts = ["# Python library", "What `from mav_tasks import …` offers."]
    for home, title in GROUPS.items():
        names = [name for its_home, name in homes if its_home == home]
        parts += [f"## {title}", *(_directive(f"mav_tasks.{name}", home) for name in names)]
        if "TaskReason" in names:
            reasons = ((f"`{each.name}`", str(each.value), words_of(each)) for each in TaskReason)
            parts.append(_table("reason, number, meaning", reasons))
    terms = (f"mav_tasks.client.terms.{name}" for name in TERMS)
    parts += ["## Terms of a task", *(_directive(each, "") for each in terms)]
    return "\n\n".join(parts)


def _home_of(value: Any) -> str:
    return max((home for home in GROUPS if value.__module__.startswith(home)), key=len)


def _directive(path: str, home: str) -> str:
    name = path.rpartition(".")[2]
    options = ""
    if name in BRIEF or home == "mav_tasks.kinds":
        options = "\n    options: { members: false, show_bases: false }"
    elif name == "TaskState":
        options = "\n    options: { show_if_no_docstring: true }"
    return f"::: {path}{options}"


def settings() -> str:
    """Return the page of all settings of the server."""
    columns = "key, meaning, valid, default, change, parameter"
    parts = ["# Settings", OF_SETTINGS]
    for table, keys in groupby(KEYS.values(), key=lambda key: key.table):
        parts += [f"## [{table}]", _table(columns, map(_setting, keys))]
    return "\n\n".join(parts)


def _setting(key: Key) -> tuple[str, ...]:
    _, _, name = key.name.partition(".")
    bound = f"; at most `{key.at_most}`" if key.at_most else ""
    valid = f"{_text(key.shape.valid)}{bound}"
    default = f"`{literal(key.plain_of(ServerSettings()))}`"
    parameter = f"`{key.parameter[1]}`" if key.parameter else ""
    change = "" if key.is_live else "restart"
    return f"`{name}`", _text(key.meaning), valid, default, change, parameter


def commands() -> str:
    """Return the page of all commands."""
    root: Any = get_command(app)
    return "\n\n".join(["# Commands", *_command(root, "mav-tasks", None, 2)])


def _command(command: Any, name: str, parent: Any, level: int) -> Iterator[str]:
    if isinstance(command, LazyCommand):
        command = command.load()
    context = command.context_class(command, info_name=name, parent=parent)
    yield f"{'#' * level} {context.command_path}"
    if isinstance(command, Program):
        yield _block(_help_of(name))
        return
    yield _block(f"{context.command_path} {' '.join(command.collect_usage_pieces(context))}")
    yield _text(command.help or "")
    records = (each.get_help_record(context) for each in command.get_params(context))
    rows = [
        (f"`{told[0]}`", _text(told[1])) for told in records if told and "--help" not in told[0]
    ]
    if rows:
        yield _table("argument or option, meaning", rows)
    if command.epilog:
        yield _block(command.epilog.replace("\b", ""))
    for each in getattr(command, "commands", {}).values():
        yield from _command(each, each.name, context, level + (parent is not None))


def _help_of(program: str) -> str:
    command = [sys.executable, "-m", "mav_tasks.cli", program, "--help"]
    wide = os.environ | {"COLUMNS": "100"}
    return subprocess.run(command, check=True, capture_output=True, text=True, env=wide).stdout


def messages() -> str:
    """Return the page of the whole policy table."""
    return f"# Messages and commands\n\n{policy_table.table()}"


def http() -> str:
    """Return the page of the HTTP API, from its OpenAPI document."""
    document = document_of(operations_of(_services()))
    operations = [
        (f"{method.upper()} {path}", operation)
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
    ]
    parts = ["# HTTP API", document["info"]["description"], OF_HTTP, "## Operations"]
    for title, operation in operations:
        parts += [f"### {title}", *_operation(operation)]
    submit = _body_of(document["paths"]["/vehicles/{vehicle}/tasks"]["post"])
    parts.append("## Goals")
    for goal in submit["properties"]["goals"]["items"]["oneOf"]:
        kind = goal["properties"]["kind"]["const"]
        parts += [f"### {kind}", goal["description"], _table(FIELDS, _fields(goal))]
    parts.append("## Answers")
    for name, schema in document["components"]["schemas"].items():
        parts += [f"### {name}", _table(FIELDS, _fields(schema)) if schema["properties"] else ""]
    return "\n\n".join(parts)


def _services() -> Services:
    """Return services as of a web process that has not begun: nothing is opened."""
    client = Client()
    live = Live(client, "", server="")
    ring = RingWatch(Path(), None)
    users = Users(ring, client, server="", own_key=None, connect=lambda _key: client)
    return Services(client, live, users, Sessions(users), "", "")


def _operation(operation: Schema) -> Iterator[str]:
    yield f"{operation['summary']}."
    yield _text(operation.get("description", ""))
    rows: list[tuple[str, ...]] = [
        (each["name"], each["in"], *_told(each["schema"], each), _is(each["required"]))
        for each in operation["parameters"]
    ]
    rows += [(name, "body", *told) for name, *told in _fields(_body_of(operation))]
    if rows:
        yield _table("name, in, type, meaning, required", rows)
    status, answer = next(iter(operation["responses"].items()))
    kinds = [_type(each["schema"]) for each in answer.get("content", {}).values()]
    yield " ".join([f"Answer: {status}", *kinds])


def _body_of(operation: Schema) -> Schema:
    content = operation.get("requestBody", {}).get("content", {})
    body: Schema = content.get("application/json", {}).get("schema", {})
    return body


def _fields(schema: Schema) -> Iterator[tuple[str, ...]]:
    """Yield name, type, meaning and whether it is required of each property."""
    for name, field in schema.get("properties", {}).items():
        yield name, *_told(field, field), _is(name in schema["required"])


def _told(schema: Schema, described: Schema) -> tuple[str, str]:
    return _type(schema), _text(described.get("description", ""))


def _is(it: bool) -> str:
    return "yes" if it else ""


def _type(schema: Schema) -> str:
    match schema:
        case {"$ref": where}:
            name = where.rpartition("/")[2]
            return f"[{name}](#{name.lower()})"
        case {"oneOf": _}:
            return "[goal](#goals)"
        case {"anyOf": several}:
            return " or ".join(map(_type, several))
        case {"const": word}:
            return f"`{literal(word)}`"
        case {"enum": words}:
            return ", ".join("null" if word is None else f"`{literal(word)}`" for word in words)
        case {"type": "array", "items": item}:
            return f"list of {_type(item)}"
        case {"type": "object", "properties": parts}:
            named = (f"`{name}`: {_type(part)}" for name, part in parts.items())
            return f"object of {', '.join(named)}"
    kinds = schema.get("type", "any")
    words = kinds if isinstance(kinds, str) else " or ".join(kinds)
    low, high = schema.get("minimum"), schema.get("maximum")
    if high is not None:
        return f"{words}, {in_digits(low or 0)} to {in_digits(high)}"
    return words if low is None else f"{words}, {in_digits(low)} or more"


def _table(columns: str, rows: Iterable[Iterable[str]]) -> str:
    names = columns.split(", ")
    lines = (names, ["---"] * len(names), *rows)
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _text(words: str) -> str:
    """Return plain words so that Markdown shows them as they are."""
    return re.sub(r"([\\`*_<|\[])", r"\\\1", " ".join(words.split()))


def _block(words: str) -> str:
    return f"```text\n{words.strip()}\n```"


#: by the names that ``nav`` has for them
PAGES: Mapping[str, Callable[[], str]] = {
    f"{page.__name__}.md": page for page in (library, http, commands, settings, messages)
}
