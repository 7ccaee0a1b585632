"""``python -m mav_tasks.web.recorded FILE...``: one run's recordings, as JSON for the map.

It is a process of its own: it needs seconds for a log of an hour, and the web process must pass on
a STOP at once. It prints one JSON object, or an error on standard error.
"""

import json
import os
import resource
import sys
from collections.abc import Sequence
from math import ceil, degrees, floor, hypot, isfinite
from pathlib import Path
from typing import Any

from mav_tasks.basics.errors import RecordError, UsageError
from mav_tasks.engine.services.persona import persona_of
from mav_tasks.engine.services.statustext import TextReceiver
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.codec import Decoder
from mav_tasks.mavlink.enums import MavAutopilot
from mav_tasks.mavlink.messages import Message
from mav_tasks.recording.sources import Happened, Heard, items_of
from mav_tasks.store.rendering import clean
from mav_tasks.tasks.events import TaskProgressed

WANTED = frozenset({m.Heartbeat.id, m.LocalPositionNed.id, m.Attitude.id, m.Statustext.id})
PERIOD = 0.2  # s between two points of a rover
APART = 0.05  # m; closer points of a slow rover are left out,
AT_LEAST = 5.0  # s, but one in so many seconds is kept
MOST_POINTS = 20_000  # of a rover
MOST_EVENTS = 5_000
MOST_MODES = 5_000  # of a rover
MEMORY = 2 << 30  # bytes
NS = 1e9


class Run:
    """What the map shows of a run."""

    def __init__(self) -> None:
        self._decoder = Decoder()
        self._texts = TextReceiver()
        self._points: dict[int, list[list[float | None]]] = {}
        self._yaw: dict[int, float] = {}
        self._modes: dict[int, list[list[Any]]] = {}
        self._events: list[dict[str, Any]] = []
        self._begins: float | None = None
        self._ends = 0.0

    def add(self, files: Sequence[Path]) -> None:
        """Read recordings; raise RecordError if one is unreadable."""
        for item in items_of(files):
            at = item.time / NS
            self._begins = at if self._begins is None else min(self._begins, at)
            self._ends = max(self._ends, at)
            match item:
                case Heard(packet=packet) if packet is not None and packet.message_id in WANTED:
                    message = self._decoder.decode(packet)
                    if message is not None:
                        self._hear(message, packet.source, at)
                case Happened(event=event) if not isinstance(event, TaskProgressed):
                    task, vehicle = getattr(event, "task_id", None), getattr(event, "vehicle", None)
                    words = clean(str(event))
                    self._event(at, words, kind="event", vehicle=vehicle, task=task)

    def form(self) -> dict[str, Any]:
        """Return the run as JSON: rovers with points, modes, and events."""
        return {
            # outwards, because the times between them are rounded
            "begins": floor((self._begins or 0.0) * 100.0) / 100.0,
            "ends": ceil(self._ends * 100.0) / 100.0,
            "vehicles": [
                {"vehicle": rover, "points": points, "modes": self._modes.get(rover, [])}
                for rover, points in sorted(self._points.items())
            ],
            "events": self._events,
        }

    def _hear(self, message: Message, source: Address, at: float) -> None:
        rover = source.system_id
        match message:
            case m.LocalPositionNed() if source.component_id == AUTOPILOT:
                self._place(rover, message, at)
            case m.Attitude() if source.component_id == AUTOPILOT:
                if isfinite(message.yaw):
                    self._yaw[rover] = round(degrees(message.yaw) % 360.0, 1)
            case m.Heartbeat(autopilot=autopilot) if autopilot != MavAutopilot.INVALID:
                if source.component_id == AUTOPILOT:
                    self._mode(rover, message, at)
            case m.Statustext():
                for text in self._texts.receive(source, message, now=at):
                    self._event(at, clean(text.words), kind="text", vehicle=rover, task=None)

    def _place(self, rover: int, message: m.LocalPositionNed, at: float) -> None:
        if not all(map(isfinite, (message.x, message.y, message.vx, message.vy))):
            return
        points = self._points.setdefault(rover, [])
        speed = hypot(message.vx, message.vy)
        point = [
            round(at, 2),
            round(message.x, 2),
            round(message.y, 2),
            self._yaw.get(rover),
            round(speed, 2),
        ]
        if points:
            before = points[-1]
            since = at - (before[0] or 0.0)
            moved = hypot(message.x - (before[1] or 0.0), message.y - (before[2] or 0.0))
            if since < PERIOD or (moved < APART and since < AT_LEAST):
                return
        points.append(point)
        if len(points) > MOST_POINTS:  # a long run is shown with fewer points
            del points[1:-1:2]

    def _mode(self, rover: int, message: m.Heartbeat, at: float) -> None:
        persona = persona_of(message)
        mode = message.custom_mode
        name = f"mode {mode}" if persona is None else persona.mode_name(mode)
        armed = bool(message.base_mode & 128)
        modes = self._modes.setdefault(rover, [])
        if len(modes) < MOST_MODES and (not modes or modes[-1][1:] != [name, armed]):
            modes.append([round(at, 2), name, armed])

    def _event(self, at: float, words: str, *, kind: str, vehicle: Any, task: Any) -> None:
        if len(self._events) < MOST_EVENTS:
            form = {"at": round(at, 2), "words": words, "kind": kind}
            self._events.append(form | {"vehicle": vehicle, "task": task})


def main() -> int:
    """Print the run of the files that are named; return the exit status."""
    os.nice(10)  # the server and the web process come first
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    run = Run()
    try:
        run.add([Path(name) for name in sys.argv[1:]])
    except (RecordError, UsageError) as error:
        sys.stderr.write(f"{error}\n")
        return 2
    except MemoryError:
        sys.stderr.write(f"{Path(sys.argv[1]).name}: it needs too much memory\n")
        return 2
    json.dump(run.form(), sys.stdout, separators=(",", ":"), allow_nan=False)
    return 0


if __name__ == "__main__":
    sys.exit(main())
