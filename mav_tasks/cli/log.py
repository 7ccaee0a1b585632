"""``mav-tasks log``: print the events of the store's journal."""

import os
import select
import sys
import time
from contextlib import closing
from math import inf
from typing import Annotated

import typer

from mav_tasks.basics.errors import StoreError, UsageError
from mav_tasks.cli import output
from mav_tasks.cli.options import Json
from mav_tasks.config.configuration import Sources
from mav_tasks.shell.logs import export
from mav_tasks.shell.logs.export import LinesOf
from mav_tasks.store.base import JournalReader, Which
from mav_tasks.store.latest import latest_store
from mav_tasks.store.opening import kind_of
from mav_tasks.store.place import without_password

MOST = 1 << 63  # the first number beyond SQLite's integers
LOOK = 0.5  # s between two checks for new events


def log(
    store: Annotated[
        str | None,
        typer.Option(
            metavar="PATH|URL",
            help="Store; default: store.path of the configuration, else the store of the "
            "server that runs, or ran last, on this machine.",
        ),
    ] = None,
    task: Annotated[
        int | None, typer.Option(metavar="ID", help="Print only events of this task.")
    ] = None,
    vehicle: Annotated[
        int | None, typer.Option(metavar="N", help="Print only events of this rover (system id).")
    ] = None,
    since: Annotated[
        str | None,
        typer.Option(
            metavar="2h|2026-11-20T10:00",
            help="Print only events of the last 30m, 2h or 7d, or since a time (UTC).",
        ),
    ] = None,
    until: Annotated[
        str | None,
        typer.Option(metavar="2h|2026-11-20T10:00", help="Print only events before that."),
    ] = None,
    as_json: Json = False,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print CSV.")] = False,
    follow: Annotated[
        bool, typer.Option("--follow", "-f", help="Keep printing new events until Ctrl-C.")
    ] = False,
) -> None:
    """Print the journal, one change per line; times are UTC.

    Reads the store; the server need not run. --json and --csv print each event by itself. On a
    terminal, long lines wrap at words.
    """
    if as_json and as_csv:
        raise UsageError("--json and --csv: choose one of them")
    for flag, number in (("--task", task), ("--vehicle", vehicle)):
        if number is not None and not 0 <= number < MOST:
            raise UsageError(f"{flag} {number}: not a valid id")
    if until is not None and follow:
        raise UsageError("--until and --follow: choose one of them")
    now = time.time()
    begin = None if since is None else export.parse_moment("--since", since, now=now)
    end = inf if until is None else export.parse_moment("--until", until, now=now)
    if store == "":
        raise StoreError("--store: expected the path or the URL of a store")
    if store is None:
        store = Sources(None, dict(os.environ)).load().settings.store or latest_store() or ""
    which = Which(task=task, vehicle=vehicle, since=begin)
    lines_of = export.text_entries
    if as_json or as_csv:
        lines_of = export.json_entries if as_json else export.csv_entries
    # a program gets whole lines
    columns = output.columns() if not as_json and not as_csv and sys.stdout.isatty() else None
    with closing(kind_of(store).open_journal(store, which)) as journal:
        try:
            if as_csv:
                sys.stdout.write(export.csv_row(export.COLUMNS))
            seen = journal.version()
            count = _print(journal, lines_of, columns, end=end)
            if not count and not follow:
                output.warn(f"no such event in {without_password(store) or 'the default store'}")
            while follow and _is_written_to(journal, seen):
                seen = journal.version()
                _print(journal, lines_of, columns, end=end)
        except BrokenPipeError:  # the reader has ended, as ``head`` does
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        except KeyboardInterrupt:
            pass  # ends --follow
        except OSError as error:
            raise UsageError(f"standard output: {error.strerror}") from error


def _print(journal: JournalReader, lines_of: LinesOf, columns: int | None, *, end: float) -> int:
    """Print the new events before ``end``, UTC; return how many lines."""
    count = 0
    for line in lines_of(entry for entry in journal.take(offset=0.0) if entry[1].at < end):
        count += 1
        sys.stdout.write(output.wrapped(line, columns) if columns else line)
    sys.stdout.flush()
    return count


def _is_written_to(journal: JournalReader, seen: int) -> bool:
    """Wait until the store changes. Return False if the reader of our output ended first."""
    poller = select.poll()
    poller.register(sys.stdout.fileno(), 0)  # errors only: the other end has closed
    while journal.version() == seen:
        if poller.poll(LOOK * 1000):
            return False
    return True
