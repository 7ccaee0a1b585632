"""Starts a server with the options of ``mav-tasks serve``."""

import os
from collections.abc import Sequence

from mav_tasks.config.configuration import Sources
from mav_tasks.config.reload import Reload
from mav_tasks.config.words import flag_of_set, given_flags
from mav_tasks.serve import serve

Given = tuple[str, str, object]  # an option, the key that it sets, and its value or None


def serve_with(given: Sequence[Given], *, set_: Sequence[str], config: str | None) -> int:
    """Run a server; return its exit status."""
    flags = [*given_flags(*given), *map(flag_of_set, set_)]
    sources = Sources(config, dict(os.environ), flags)
    configuration = sources.load()
    return serve(configuration.settings, reload=Reload(sources, configuration))
