"""Standard output: lines, JSON objects and tables, adapted to the terminal."""

import json
import os
import shutil
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

DUMB = ("dumb", "unknown", "")
PIPE_WIDTH = 1000  # columns: nothing is cut for a program that reads
INDENT = " " * 4  # of the second and further lines of one that is wrapped
NARROWEST = 20  # columns; in a narrower terminal the words break


def is_drawn_on() -> bool:
    """Return whether written lines can be overwritten: on a terminal that is not dumb."""
    return sys.stdout.isatty() and os.environ.get("TERM", "").lower() not in DUMB


def console() -> "Console":
    """Return the console for tables, in colours on a terminal unless NO_COLOR is set."""
    from rich.console import Console  # noqa: PLC0415

    is_drawn = is_drawn_on()
    plain_width = columns() if sys.stdout.isatty() else PIPE_WIDTH
    has_colour = is_drawn and not os.environ.get("NO_COLOR")
    return Console(
        force_terminal=is_drawn,
        color_system="auto" if has_colour else None,
        highlight=False,
        markup=False,
        emoji=False,
        width=None if is_drawn else plain_width,
    )


def say(text: str) -> None:
    """Write a line and flush."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def warn(text: str) -> None:
    """Write a line on standard error, unless ``text`` is empty."""
    if text:
        sys.stderr.write(f"mav-tasks: {text}\n")


def say_json(value: dict[str, Any]) -> None:
    """Write a JSON object as one line and flush."""
    say(json.dumps(value))


def say_done(as_json: bool, action: str, words: str, **fields: object) -> None:
    """Report a completed request: as text, or as a JSON object with ``fields``."""
    if as_json:
        say_json({"done": action, **fields})
    else:
        say(words)


def show(what: "RenderableType") -> None:
    """Print a table, without trailing blanks unless on a terminal."""
    target = console()
    if target.is_terminal:
        target.print(what)
        return
    with target.capture() as captured:
        target.print(what)
    say("\n".join(line.rstrip() for line in captured.get().rstrip("\n").split("\n")))


def columns() -> int:
    return shutil.get_terminal_size().columns


def wrapped(line: str, width: int) -> str:
    """Return a line wrapped at words to a terminal's width; an indent marks what continues it."""
    if len(line.rstrip("\n")) <= width:
        return line
    from textwrap import wrap  # noqa: PLC0415

    return "".join(
        f"{piece}\n"
        for piece in wrap(
            line,
            max(width, NARROWEST),
            subsequent_indent=INDENT,
            break_long_words=False,  # the terminal breaks them, and they can be copied whole
            break_on_hyphens=False,
        )
    )
