"""Records of a run: telemetry logs for ground stations, and decisions that can be replayed.

Witnesses (see ``witness.py``) only take notes while the server works; threads of their own write.
"""

from mav_tasks.recording.decisions import Decisions
from mav_tasks.recording.new_files import prepared
from mav_tasks.recording.tlog import Tlog
from mav_tasks.settings import Recording, Settings
from mav_tasks.tasks.restored import Restored
from mav_tasks.witness import Witness

__all__ = ["witnesses"]


def witnesses(
    recording: Recording, settings: Settings, restored: Restored | None, *, now: float
) -> list[Witness]:
    """Give who keeps the records that are asked for, of an engine that gets the same three values.

    RecordError: they cannot be kept there.
    """
    found: list[Witness] = []
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
