"""Records of a run: telemetry logs for ground stations, and decision records for replay.

Recorders are observers of the engine (``observer.py``) that queue entries; their threads write.
"""

import time

from mav_tasks.config.settings import Recording, Settings
from mav_tasks.recording.decisions import Decisions
from mav_tasks.recording.new_files import prepared, stamp
from mav_tasks.recording.observer import EngineObserver
from mav_tasks.recording.tlog import Tlog
from mav_tasks.tasks.restored import Restored

__all__ = ["observers"]


def observers(
    recording: Recording,
    settings: Settings,
    restored: Restored | None,
    *,
    now: float,
    utc: float | None = None,
) -> list[EngineObserver]:
    """Return the recorders of the settings; raise RecordError if a folder cannot be used.

    ``settings``, ``restored`` and ``now`` must be those of the engine. ``utc``, else the wall
    clock, names the files of both: a reader takes what has one name for one run.
    """
    start = stamp(time.time() if utc is None else utc)
    found: list[EngineObserver] = []
    if recording.tlog:
        found.append(
            Tlog(
                prepared(recording.tlog),
                size=recording.tlog_size,
                count=recording.tlog_files,
                component_id=settings.identity.component_id,
                start=start,
            )
        )
    if recording.decisions:
        folder = prepared(recording.decisions)
        size = recording.decisions_size
        found.append(Decisions(folder, settings, restored, now=now, size=size, start=start))
    return found
