"""Starts a server with the options of ``mav-tasks serve``."""

import os
from collections.abc import Sequence
from contextlib import nullcontext

from mav_tasks.basics.errors import StoreError
from mav_tasks.cli.page_beside import page_beside
from mav_tasks.config.configuration import Sources
from mav_tasks.config.reload import Reload
from mav_tasks.config.words import Flag, flag_of_set
from mav_tasks.shell.serve import serve
from mav_tasks.store.opening import IN_MEMORY


def serve_with(flags: Sequence[Flag], *, set_: Sequence[str], config: str | None, web: str) -> int:
    """Run a server; return its exit status. Raise StoreError if the store has no name.

    ``web``: the address of a web page beside it; "": none.
    """
    if any((flag.where, flag.value) == ("--store", "") for flag in flags):
        raise StoreError(f"--store: expected a path, a URL of PostgreSQL, or {IN_MEMORY}")
    sources = Sources(config, dict(os.environ), [*flags, *map(flag_of_set, set_)])
    configuration = sources.load()
    settings = configuration.settings
    with page_beside(web, settings) if web else nullcontext():
        return serve(settings, reload=Reload(sources, configuration))
