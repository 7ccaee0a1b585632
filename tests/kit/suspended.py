"""``python -m tests.kit.suspended FLAG serve …``: mav-tasks, stopped in the middle of a turn.

When the file FLAG exists, the server stops (SIGSTOP) at the worst moment: a moving setpoint is
ready, but has not left yet.
"""

import os
import signal
import sys
from pathlib import Path

from mav_tasks.cli.app import main
from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import Outgoing
from mav_tasks.mavlink import messages as m
from tests.kit.capture import moves

VELOCITIES = slice(10 + 16, 10 + 28)  # vx, vy, vz of SET_POSITION_TARGET_LOCAL_NED


def stop_at(flag: Path) -> None:
    """Patch the engine to stop the process at a moving setpoint."""
    take_packets = Engine.take_packets

    def of_engine(self: Engine) -> list[Outgoing]:
        packets = take_packets(self)
        if any(map(_moves, packets)) and flag.exists():
            flag.unlink()
            os.kill(os.getpid(), signal.SIGSTOP)
        return packets

    Engine.take_packets = of_engine  # type: ignore[method-assign]


def _moves(outgoing: Outgoing) -> bool:
    data = outgoing.data
    return data[7] == m.SetPositionTargetLocalNed.id and data[8] == 0 and moves(data[VELOCITIES])


if __name__ == "__main__":
    stop_at(Path(sys.argv[1]))
    del sys.argv[1]
    main()
