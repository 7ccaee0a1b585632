"""What MkDocs lacks for the site: pages from the whole repository, and the reference from the code.

Each page has the path that it has in the repository, so that links between pages need no change;
MkDocs checks them. A link to a file that is no page leads below ``Source`` of ``[project.urls]``;
while the owner has not said where the source is, its text stays alone. Diagrams are drawn here,
without a script. No page may make a browser ask another host.
"""

import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from posixpath import dirname, join, normpath
from typing import Any

from jinja2 import Environment, StrictUndefined
from mermaidx import render
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.plugins import get_plugin_logger
from mkdocs.structure.files import File, Files, InclusionLevel
from mkdocs.structure.pages import Page
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

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.append(str(ROOT / "tools"))

from generators.documents import full_plans, full_policy  # noqa: E402

README = (ROOT / "README.md").read_text(encoding="utf-8")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
#: no ``repo_url`` of MkDocs: with one, pages would ask GitHub
SOURCE = PROJECT.get("urls", {}).get("Source", "")
RELATIVE = re.compile(r"(?<!!)\[([^\]]+)\]\((?!\w+:|#)([^)\s]+)\)")
DIAGRAM = re.compile(r"^```mermaid\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FOREIGN = re.compile(r"<(?:script|link|img|iframe|source)\b[^>]*?\b(?:src|href)=\"?(?:https?:)?//")
#: wide tables and diagrams need room; a diagram is drawn for a light ground
CSS = """
.md-grid { max-width: 84rem; }
.md-typeset img[src$=".svg"] { background: white; padding: 0.4rem; }
.md-typeset table:not([class]) td code { white-space: normal; word-break: normal; }
.md-typeset td:nth-child(2) { min-width: 8rem; }
"""

log = get_plugin_logger("site")


def on_files(files: Files, config: MkDocsConfig) -> None:
    """Put the files that match into ``nav``; add them, and the pictures of the guide."""
    reference = _reference()
    files.append(File.generated(config, "site.css", content=CSS))
    paths = _matching("mav_tasks/guide/images/*")
    for section in config.nav or []:
        for title, patterns in section.items():
            section[title] = [path for pattern in patterns for path in _matching(pattern)]
            paths += section[title]
    for path in paths:
        if path.startswith("reference/"):
            file = File.generated(config, path, content=getattr(reference, Path(path).stem)())
        else:
            place, inclusion = str(ROOT / path), InclusionLevel.INCLUDED
            file = File.generated(config, path, abs_src_path=place, inclusion=inclusion)
            file.dest_uri = file.dest_uri.removeprefix(".github/")  # servers may hide such a folder
        files.append(file)


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Draw the diagrams of a page, and look at its links to the source."""
    uri = page.file.src_uri

    def linked(found: re.Match[str]) -> str:
        text, target = found.groups()
        path = normpath(join(dirname(uri), target.partition("#")[0]))
        if path.endswith(".md") or files.get_file_from_path(path) or not (ROOT / path).exists():
            return found[0]
        return f"[{text}]({SOURCE}/blob/main/{path})" if SOURCE else text

    def drawn(found: re.Match[str]) -> str:
        name = f"{page.file.name}-{found.start()}.svg"
        svg = render(found[1]).svg()
        files.append(File.generated(config, join(dirname(uri), name), content=svg))
        return f"[![Diagram of what is said here]({name})]({name})"

    return RELATIVE.sub(linked, DIAGRAM.sub(drawn, markdown))


def on_post_page(output: str, page: Page, **_others: object) -> None:
    """Warn of what a browser would fetch from another host."""
    for found in FOREIGN.finditer(output):
        log.warning("%s fetches from another host: %s", page.file.src_uri, found[0])


def _matching(pattern: str) -> list[str]:
    """Return the files that match, first those that the README links to; else what is no pattern.

    A page of the reference is no file of the repository.
    """
    found = [path.relative_to(ROOT).as_posix() for path in ROOT.glob(pattern)]
    found.sort(key=lambda name: (name not in README, README.find(name), name))
    return found if found or "*" in pattern else [pattern]


def _reference() -> Any:
    """Return the macros of reference.md.jinja; each returns a page."""
    client, ring = Client(), RingWatch(Path(), None)
    users = Users(ring, client, server="", own_key=None, connect=lambda _key: client)
    live = Live(client, "", server="")  # of a web process that has not begun
    services = Services(client, live, users, Sessions(users), "", "")
    shown = {
        "exported": mav_tasks._HOMES,
        "reasons": TaskReason,
        "words_of": words_of,
        "keys": KEYS.values(),
        "defaults": ServerSettings(),
        "literal": literal,
        "in_digits": in_digits,
        "all_commands": list(_commands(get_command(app), "mav-tasks", None)),
        "api": document_of(operations_of(services)),
        "policy": full_policy(),
        "plans": full_plans(),
    }
    made = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    text = (HERE / "reference.md.jinja").read_text(encoding="utf-8")
    return made.from_string(text).make_module(shown)


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
