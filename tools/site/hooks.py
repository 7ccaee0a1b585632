"""What MkDocs lacks for the site: pages from the whole repository, diagrams without a script.

``on_config`` finds the files for the patterns of ``nav``, and ``on_files`` adds them: each page has
the path that it has in the repository, so that links between pages need no change. MkDocs checks
these links. A link to a file that is no page leads below ``Source`` of ``[project.urls]``; while
the owner has not said where the source is, its text stays alone. No page may make a browser ask
another host.
"""

import re
import tomllib
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from posixpath import dirname, join, normpath
from typing import Any

from mermaidx import render
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.plugins import get_plugin_logger
from mkdocs.structure.files import File, Files, InclusionLevel
from mkdocs.structure.pages import Page

import reference

ROOT = Path(__file__).resolve().parents[2]
PICTURES = "mav_tasks/guide/images/*"
RELATIVE = re.compile(r"(?<!!)\[([^\]]+)\]\((?!\w+:|#)([^)\s]+)\)")
DIAGRAM = re.compile(r"^```mermaid\n(.*?)^```$", re.MULTILINE | re.DOTALL)
HEADING = re.compile(r"^#+ (.*)$", re.MULTILINE)
FOREIGN = re.compile(r"<(?:script|link|img|iframe|source)\b[^>]*?\b(?:src|href)=\"?(?:https?:)?//")

log = get_plugin_logger("site")


def on_config(config: MkDocsConfig) -> None:
    """Put the files that match into ``nav``."""
    config.nav = list(_expanded(config.nav or []))


def on_files(files: Files, config: MkDocsConfig) -> None:
    """Add the pages of ``nav`` and the pictures of the guide."""
    pictures = (path.relative_to(ROOT).as_posix() for path in ROOT.glob(PICTURES))
    add = partial(File.generated, config, inclusion=InclusionLevel.INCLUDED)
    for path in [*_paths(config.nav or []), *pictures]:
        folder, _, name = path.partition("/")
        if folder == "reference":
            files.append(add(path, content=reference.PAGES[name]()))
            continue
        file = add(path, abs_src_path=str(ROOT / path))
        file.dest_uri = file.dest_uri.removeprefix(".github/")  # servers may hide such a folder
        files.append(file)


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Draw the diagrams of a page, and look at its links to the source."""

    def linked(found: re.Match[str]) -> str:
        text, target = found.groups()
        path = normpath(join(dirname(page.file.src_uri), target.partition("#")[0]))
        is_source = (ROOT / path).exists() and not path.endswith(".md")
        if not is_source or files.get_file_from_path(path):
            return found[0]
        return f"[{text}]({_source()}/blob/main/{path})" if _source() else text

    def drawn(found: re.Match[str]) -> str:
        uri = f"{page.file.src_uri.removesuffix('.md')}-{found.start()}.svg"
        files.append(File.generated(config, uri, content=render(found[1]).svg()))
        about = HEADING.findall(markdown, 0, found.start())[-1]
        return f"[![Diagram: {about}]({Path(uri).name})]({Path(uri).name})"

    return RELATIVE.sub(linked, DIAGRAM.sub(drawn, markdown))


def on_post_page(output: str, page: Page, **_others: object) -> None:
    """Warn of what a browser would fetch from another host."""
    for found in FOREIGN.finditer(output):
        log.warning("%s fetches from another host: %s", page.file.src_uri, found[0])


def _expanded(entries: list[Any]) -> Iterator[Any]:
    for entry in entries:
        if isinstance(entry, dict):
            yield {
                title: list(_expanded(below)) if isinstance(below, list) else below
                for title, below in entry.items()
            }
        elif "*" in entry:
            found = sorted(ROOT.glob(entry), key=_place)
            yield from (path.relative_to(ROOT).as_posix() for path in found)
        else:
            yield entry


def _place(path: Path) -> tuple[bool, int, str]:
    """Return what orders the files of a folder."""
    beside = path.parent / "README.md"
    text = (beside if beside.exists() else ROOT / "README.md").read_text(encoding="utf-8")
    found = re.search(rf"[/(]{re.escape(path.name)}", text)
    return path != beside, found.start() if found else len(text), path.name


def _paths(entries: list[Any]) -> Iterator[str]:
    for entry in entries:
        if isinstance(entry, dict):
            for below in entry.values():
                yield from _paths(below if isinstance(below, list) else [below])
        else:
            yield entry


@cache
def _source() -> str:
    """Return the address of the source. It is no ``repo_url``: then pages would ask GitHub."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return str(project.get("urls", {}).get("Source", "")).rstrip("/")
