"""Scripts that use MAVSDK, each a process of its own: a crash takes down nothing else."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from mav_tasks.links.memory import Conditions
from tests.kit.lossy_udp import lossy_udp
from tests.kit.processes import STOP_LIMIT, Stand

FACES = {"sync": "", "asyncio": "asyncio_"}
LOSS = 0.2  # of the datagrams, each way
NETS = {0.0: "nothing lost", LOSS: "a fifth lost"}
#: each make of rover on each net, each face on each net: not each with each, which would take ten
#: minutes more
CASES = (
    ("ardupilot", "sync", 0.0),
    ("ardupilot", "asyncio", 0.0),
    ("ardupilot", "asyncio", LOSS),
    ("px4", "sync", 0.0),
    ("px4", "asyncio", 0.0),
    ("px4", "sync", LOSS),
    ("generic", "sync", 0.0),
    ("generic", "asyncio", LOSS),
)
ROOT = Path(__file__).resolve().parents[2]
LIMIT = 150.0  # s for a script
SEED = 20
#: How often an operation may be tried where datagrams get lost; one that MAVSDK gives up has
#: been sent four times by itself.
TRIES = 8

each_case = pytest.mark.parametrize(
    ("persona", "face", "loss"),
    [
        pytest.param(make, FACES[face], loss, id=f"{make}-{face}-{NETS[loss]}")
        for make, face, loss in CASES
    ],
)
each_net = pytest.mark.parametrize("loss", list(NETS), ids=list(NETS.values()))


@contextmanager
def clients_port(running: Stand, loss: float) -> Iterator[int]:
    """Return the port at which clients reach the server, through a net that loses so much."""
    if not loss:
        yield running.client_port
        return
    with lossy_udp(running.client_port, Conditions(loss=loss), seed=SEED) as proxy:
        yield proxy.port
    came, lost = (
        sum(getattr(way, what) for way in (proxy.to_server, proxy.to_clients))
        for what in ("came", "lost")
    )
    assert lost > came * loss / 2, proxy


def run_script(script: str, running: Stand, *, persona: str, loss: float) -> str:
    """Run one of ``tests/interop/scripts`` to its end; gives what it printed."""
    with clients_port(running, loss) as port:
        address = f"udpout://127.0.0.1:{port}"
        return finish(script, address, persona=persona, loss=loss, running=running)


def finish(script: str, address: str, *, persona: str, loss: float, running: Stand) -> str:
    """As ``run_script``, where MAVSDK is told that address.

    It must end by itself and well: a signal, an abort or an error of MAVSDK's that is left after
    the last try is a failure, and so is one that never ends.
    """
    tries = TRIES if loss else 1
    module = f"tests.interop.scripts.{script}"
    with subprocess.Popen(
        [sys.executable, "-X", "faulthandler", "-m", module, address, persona, str(tries)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=ROOT,
    ) as process:
        try:
            said, _ = process.communicate(timeout=LIMIT)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGABRT)  # tells where each of its threads is
            said, _ = process.communicate(timeout=STOP_LIMIT)
        finally:
            process.kill()
    told = f"{said}\n{running.server.text}"
    assert process.returncode == 0, f"{script} ended with {process.returncode}\n{told}"
    assert said.rstrip().endswith("done"), told
    return said
