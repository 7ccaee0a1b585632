"""Starts the log: what is said, in which format, and by whom it is written."""

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from mav_tasks.logs.lines import LineOf, Lines, TextLines, json_line
from mav_tasks.logs.writing import ThreadedHandler
from mav_tasks.settings import Log


@contextmanager
def log_to_stderr(settings: Log) -> Iterator[None]:
    """Write the log where the operator sees it, while the block runs."""
    # Each event is one line, and under load there are thousands a second: what no line shows is
    # not looked up for it (logging's own manual, "Optimization").
    logging._srcfile = None
    logging.logThreads = logging.logProcesses = logging.logMultiprocessing = False
    log = logging.getLogger("mav_tasks")
    log.setLevel(settings.level.upper())
    root = logging.getLogger()
    root.setLevel(max(log.level, logging.INFO))  # what asyncio says to itself helps nobody
    line_of: LineOf = json_line if settings.format == "json" else TextLines()
    # Closed from the beginning: its number may by now be that of something else, the store's, say.
    handler = ThreadedHandler(sys.stderr.fileno(), Lines(line_of)) if sys.stderr else None
    if handler is not None:
        root.addHandler(handler)
        logging.captureWarnings(True)  # they would wait for standard error
    else:
        root.addHandler(logging.NullHandler())
    try:
        yield
    finally:
        if handler is not None:
            logging.captureWarnings(False)
            root.removeHandler(handler)
            handler.close()
