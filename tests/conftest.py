"""No test, and no process of one, reads the configuration of whoever runs the tests."""

import os
import signal
import threading

import pytest

from tests.kit.run_again import RunAgain

for name in [name for name in os.environ if name.startswith("MAV_TASKS_")]:
    del os.environ[name]
os.environ["MAV_TASKS_CONFIG"] = ""

# pymavlink settles on a version of MAVLink when it is first imported, whichever test that is in.
os.environ["MAVLINK20"] = "1"

# A shell lets what it runs in the background ignore Ctrl-C, and so would all that tests begin.
if (
    threading.current_thread() is threading.main_thread()
    and signal.getsignal(signal.SIGINT) is signal.SIG_IGN
):
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_configure(config: pytest.Config) -> None:
    """Run again what failed while the machine stood still."""
    config.pluginmanager.register(RunAgain())
