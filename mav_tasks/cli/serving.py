"""Starts a server with the options of ``mav-tasks serve``."""

import os
from collections.abc import Sequence

from mav_tasks.config.configuration import Sources
from mav_tasks.config.reload import Reload
from mav_tasks.config.words import Flag, flag_of_set
from mav_tasks.errors import StoreError
from mav_tasks.serve import serve
from mav_tasks.store.opening import IN_MEMORY


def serve_with(flags: Sequence[Flag], *, set_: Sequence[str], config: str | None) -> int:
    """Run a server; return its exit status. Raise StoreError if the store has no name."""
    if any((flag.where, flag.value) == ("--store", "") for flag in flags):
        raise StoreError(f"--store: expected a path, a URL of PostgreSQL, or {IN_MEMORY}")
    sources = Sources(config, dict(os.environ), [*flags, *map(flag_of_set, set_)])
    configuration = sources.load()
    return serve(configuration.settings, reload=Reload(sources, configuration))
