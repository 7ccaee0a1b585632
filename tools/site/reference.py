"""What the reference shows: the templates in templates/ are filled in from the code with it."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from typer.main import get_command

import mav_tasks
from mav_tasks.cli.app import app
from mav_tasks.cli.lazy import LazyCommand
from mav_tasks.client.aio import Client
from mav_tasks.config.key_ring.watch import RingWatch
from mav_tasks.config.setting_keys.literals import in_digits, literal
from mav_tasks.config.settings import KEYS, ServerSettings
from mav_tasks.tasks.lifecycle import TaskReason, words_of
from mav_tasks.web.application import operations_of
from mav_tasks.web.live import Live
from mav_tasks.web.openapi import document_of
from mav_tasks.web.services import Services
from mav_tasks.web.sessions import Sessions
from mav_tasks.web.users import Users

sys.path.append(str(Path(__file__).resolve().parents[1]))  # the folder of the tools

from generators.tables import full_plans, full_policy


def shown() -> dict[str, Any]:
    """Return what the templates name."""
    return {
        "exported": mav_tasks._HOMES,
        "reasons": TaskReason,
        "words_of": words_of,
        "settings": KEYS.values(),
        "defaults": ServerSettings(),
        "literal": literal,
        "in_digits": in_digits,
        "commands": list(_commands(get_command(app), "mav-tasks", None)),
        "api": document_of(operations_of(_services())),
        "policy": full_policy(),
        "plans": full_plans(),
    }


def _commands(command: Any, name: str, parent: Any) -> Iterator[dict[str, Any]]:
    if isinstance(command, LazyCommand):
        command = command.load()
    context = command.context_class(command, info_name=name, parent=parent)
    usage = " ".join([context.command_path, *command.collect_usage_pieces(context)])
    records = (each.get_help_record(context) for each in command.get_params(context))
    yield {
        "name": context.command_path,
        "usage": usage,
        "help": command.help,
        "options": [record for record in records if record and "--help" not in record[0]],
        "epilog": command.epilog,
    }
    for each in getattr(command, "commands", {}).values():
        yield from _commands(each, each.name, context)


def _services() -> Services:
    """Return services as of a web process that has not begun: nothing is opened."""
    client = Client()
    ring = RingWatch(Path(), None)
    users = Users(ring, client, server="", own_key=None, connect=lambda _key: client)
    return Services(client, Live(client, "", server=""), users, Sessions(users), "", "")
