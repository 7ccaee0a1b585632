"""Records of a run: telemetry logs for ground stations, and decisions that can be replayed.

Observers of the engine (``observer.py``) only take notes; threads of their own write.
"""

from mav_tasks.observer import EngineObserver
from mav_tasks.recording.decisions import Decisions
from mav_tasks.recording.new_files import prepared
from mav_tasks.recording.tlog import Tlog
from mav_tasks.settings import Recording, Settings
from mav_tasks.tasks.restored import Restored

__all__ = ["observers"]


def observers(
    recording: Recording, settings: Settings, restored: Restored | None, *, now: float
) -> list[EngineObserver]:
    """Return the recorders that the settings ask for; the engine gets the same three values.

    RecordError: they cannot be kept there.
    """
    found: list[EngineObserver] = []
    if recording.tlog:
        found.append(
            Tlog(
                prepared(recording.tlog),
                size=recording.tlog_size,
                count=recording.tlog_files,
                component_id=settings.identity.component_id,
            )
        )
    if recording.decisions:
        folder = prepared(recording.decisions)
        size = recording.decisions_size
        found.append(Decisions(folder, settings, restored, now=now, size=size))
    return found
