"""Sets up the log: level, format and handler."""

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from mav_tasks.config.settings import Log
from mav_tasks.shell.logs.lines import LineOf, Lines, TextLines, json_line
from mav_tasks.shell.logs.writing import ThreadedHandler


@contextmanager
def log_to_stderr(settings: Log) -> Iterator[None]:
    """Write the log to standard error while the block runs."""
    # Under load there are thousands of lines a second: skip the collection of fields that no line
    # shows (logging's manual, "Optimization").
    logging._srcfile = None
    logging.logThreads = logging.logProcesses = logging.logMultiprocessing = False
    log = logging.getLogger("mav_tasks")
    log.setLevel(settings.level.upper())
    root = logging.getLogger()
    root.setLevel(max(log.level, logging.INFO))  # no debug messages of asyncio
    line_of: LineOf = json_line if settings.format == "json" else TextLines()
    # If stderr was closed at start, its descriptor may now be another file's, such as the store's.
    handler = ThreadedHandler(sys.stderr.fileno(), Lines(line_of)) if sys.stderr else None
    if handler is not None:
        root.addHandler(handler)
        logging.captureWarnings(True)  # warnings would block on standard error
    else:
        root.addHandler(logging.NullHandler())
    try:
        yield
    finally:
        if handler is not None:
            logging.captureWarnings(False)
            root.removeHandler(handler)
            handler.close()
