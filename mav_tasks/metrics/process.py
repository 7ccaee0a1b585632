"""Figures of this process, under the names that all Prometheus clients use.

Figures that the system does not have are left out: only Linux has /proc.
"""

import os
import resource
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from mav_tasks.metrics.exposition import Family, Sample

CPU = Family("process_cpu_seconds_total", "counter", "Processor time used, user and system.")
START = Family("process_start_time_seconds", "gauge", "When the process started, since 1970.")
RESIDENT = Family("process_resident_memory_bytes", "gauge", "Memory in use (resident set).")
VIRTUAL = Family("process_virtual_memory_bytes", "gauge", "Virtual memory.")
OPEN_FDS = Family("process_open_fds", "gauge", "Open file descriptors.")
MAX_FDS = Family("process_max_fds", "gauge", "Limit of open file descriptors.")
FAMILIES = (CPU, START, RESIDENT, VIRTUAL, OPEN_FDS, MAX_FDS)

SELF = Path("/proc/self")
STARTED = 19  # field of /proc/PID/stat after the name in parentheses: clock ticks since boot


def figures() -> Iterator[tuple[Family, list[Sample]]]:
    """Yield the families with their samples; reads files of /proc, which never block."""
    yield CPU, [((), time.process_time())]
    with suppress(OSError, ValueError, IndexError):
        stat = (SELF / "stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2]
        ticks = int(stat.split()[STARTED])
        booted = time.time() - time.clock_gettime(time.CLOCK_BOOTTIME)
        yield START, [((), round(booted + ticks / os.sysconf("SC_CLK_TCK"), 2))]
    with suppress(OSError, ValueError, IndexError):
        pages = (SELF / "statm").read_text(encoding="ascii").split()
        size = os.sysconf("SC_PAGE_SIZE")
        yield RESIDENT, [((), int(pages[1]) * size)]
        yield VIRTUAL, [((), int(pages[0]) * size)]
    with suppress(OSError):
        yield OPEN_FDS, [((), len(list((SELF / "fd").iterdir())))]
    yield MAX_FDS, [((), resource.getrlimit(resource.RLIMIT_NOFILE)[0])]
