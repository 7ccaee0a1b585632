"""What MkDocs lacks for the site: pages from the whole repository, diagrams without a script.

Each page has the path that it has in the repository, so that links between pages need no change;
MkDocs checks them. A link to a file that is no page leads below ``Source`` of ``[project.urls]``;
while the owner has not said where the source is, its text stays alone. No page may make a browser
ask another host.
"""

import re
import tomllib
from pathlib import Path
from posixpath import basename, dirname, join, normpath

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from mermaidx import render
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.plugins import get_plugin_logger
from mkdocs.structure.files import File, Files, InclusionLevel
from mkdocs.structure.pages import Page

import reference

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
#: no ``repo_url`` of MkDocs: with one, pages would ask GitHub
SOURCE = PROJECT.get("urls", {}).get("Source", "")
RELATIVE = re.compile(r"(?<!!)\[([^\]]+)\]\((?!\w+:|#)([^)\s]+)\)")
DIAGRAM = re.compile(r"^```mermaid\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FOREIGN = re.compile(r"<(?:script|link|img|iframe|source)\b[^>]*?\b(?:src|href)=\"?(?:https?:)?//")

log = get_plugin_logger("site")
templates = Environment(
    loader=FileSystemLoader(ROOT / "tools/site/templates"),
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)


def on_files(files: Files, config: MkDocsConfig) -> None:
    """Put the files that match into ``nav``; add them, and the pictures of the guide."""
    shown = reference.shown()
    paths = _matching("mav_tasks/guide/images/*")
    for section in config.nav or []:
        for title, patterns in section.items():
            section[title] = [path for pattern in patterns for path in _matching(pattern)]
            paths += section[title]
    for path in paths:
        if path.startswith("reference/"):
            template = templates.get_template(f"{basename(path)}.jinja")
            file = File.generated(config, path, content=template.render(shown))
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
