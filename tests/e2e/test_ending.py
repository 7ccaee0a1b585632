"""SIGTERM while a server starts its loop: it ends, wherever in the loop's code the signal comes."""

import subprocess
import sys
from pathlib import Path

from tests.kit.processes import environment_with, free_udp_ports

#: forks a server for each line that a running loop executes before the server's own code, and
#: signals it there
SCRIPT = """
import asyncio, os, signal, sys, time
from mav_tasks.cli.app import main
from mav_tasks.shell.runner import Runner

FOLDER = os.path.dirname(asyncio.__file__)
RUNNING = asyncio.BaseEventLoop.run_forever.__code__

def serve_signalled_at(number):
    lines = 0
    is_running = False

    def trace(frame, event, _):
        nonlocal lines, is_running
        if not frame.f_code.co_filename.startswith(FOLDER):
            if frame.f_code is Runner._serve.__code__:
                sys.settrace(None)
            return None
        is_running = is_running or frame.f_code is RUNNING
        lines += is_running and event == "line"
        if lines == number:
            sys.settrace(None)
            os.kill(os.getpid(), signal.SIGTERM)
        return trace

    serve = Runner.serve

    def traced(self, loops):
        sys.settrace(trace)
        return serve(self, loops)

    Runner.serve = traced
    Runner._tend = lambda self, loop: self._finish(9) if lines < number else None  # no signal came
    try:
        main()
    except SystemExit as end:
        os._exit(end.code or 0)

def status_of(pid):
    end = time.monotonic() + 20
    while time.monotonic() < end:
        ended, status = os.waitpid(pid, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.005)
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    return "it hangs"

number = status = 0
while status == 0:
    number += 1
    sys.stdout.flush()
    pid = os.fork()
    if pid == 0:
        serve_signalled_at(number)
    status = status_of(pid)
print(f"after {number} lines: {status}")
"""


def test_a_signal_that_comes_while_the_loop_starts_ends_the_server(tmp_path: Path) -> None:
    client, vehicle = free_udp_ports(2)
    done = subprocess.run(
        [
            *(sys.executable, "-c", SCRIPT, "serve", "--no-push", "--store", ":memory:"),
            *("--client", f"udpin:127.0.0.1:{client}", "--vehicle", f"udpout:127.0.0.1:{vehicle}"),
        ],
        stdout=subprocess.PIPE,
        cwd=tmp_path,
        env=environment_with(XDG_CONFIG_HOME=str(tmp_path), XDG_STATE_HOME=str(tmp_path)),
        text=True,
        timeout=100,
        check=True,
    )
    lines, end = done.stdout.splitlines()[-1].removeprefix("after ").split(" lines: ")
    assert end == "9", done.stdout  # the first one that no signal had reached
    assert int(lines) > 20
