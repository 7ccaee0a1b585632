"""``python -m tests.kit.asleep SECONDS serve …``: mav-tasks on a machine that is suspended.

At each SIGUSR1 the server's clock jumps by SECONDS, while timers and CLOCK_MONOTONIC do not, as
after a suspension.
"""

import signal
import sys

from mav_tasks.basics import clock
from mav_tasks.cli.app import main


def sleep_at_signal(seconds: float) -> None:
    """Patch the clock, before another module imports it by name."""
    awake = clock.boot_time
    slept = 0.0

    def on_signal(_number: int, _frame: object) -> None:
        nonlocal slept
        slept += seconds

    clock.boot_time = lambda: awake() + slept
    signal.signal(signal.SIGUSR1, on_signal)


if __name__ == "__main__":
    sleep_at_signal(float(sys.argv[1]))
    del sys.argv[1]
    main()
