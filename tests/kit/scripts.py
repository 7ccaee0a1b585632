"""Scripts that use MAVSDK, each in its own process, so that a crash affects nothing else."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from tests.kit.lossy_udp import LossyUdp
from tests.kit.processes import STOP_LIMIT, Stand
from tests.kit.volume import some

LOSS = 0.2  # of the datagrams, each way
NETS = {0.0: "nothing lost", LOSS: "a fifth lost"}
ROOT = Path(__file__).resolve().parents[2]
LIMIT = 150.0  # s for a script
SEED = 20
#: How often an operation may be tried on a lossy net; MAVSDK itself has sent it four times before
#: it gives up.
TRIES = 8

#: of tests of half a minute
some_cases = pytest.mark.parametrize(
    ("persona", "loss"), some([("ardupilot", 0.0), ("ardupilot", LOSS), ("px4", 0.0)], 1, 2)
)
some_makes = pytest.mark.parametrize(("persona", "loss"), [("ardupilot", 0.0), ("px4", LOSS)])
a_net = pytest.mark.parametrize("loss", some([*NETS], -1), ids=NETS.get)


@contextmanager
def clients_port(running: Stand, loss: float) -> Iterator[int]:
    """Return the port at which clients reach the server, through a net with this loss."""
    if not loss:
        yield running.client_port
        return
    with closing(LossyUdp(running.client_port, loss=loss, seed=SEED)) as proxy:
        yield proxy.port
    came, lost = (
        sum(getattr(way, what) for way in (proxy.to_server, proxy.to_clients))
        for what in ("came", "lost")
    )
    assert lost > came * loss / 2, proxy


def run_script(script: str, running: Stand, *, persona: str, loss: float) -> str:
    """Run one of ``tests/interop/scripts`` to its end; return its output."""
    with clients_port(running, loss) as port:
        address = f"udpout://127.0.0.1:{port}"
        return finish(script, address, persona=persona, loss=loss, running=running)


def finish(script: str, address: str, *, persona: str, loss: float, running: Stand) -> str:
    """Run a script like ``run_script``, with this address for MAVSDK.

    It must end by itself and successfully: a signal, an abort, a MAVSDK error after the last try,
    or a time-out fails the test.
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
            process.send_signal(signal.SIGABRT)  # prints the stack of each thread
            said, _ = process.communicate(timeout=STOP_LIMIT)
        finally:
            process.kill()
    told = f"{said}\n{running.server.text}"
    assert process.returncode == 0, f"{script} ended with {process.returncode}\n{told}"
    assert said.rstrip().endswith("done"), told
    return said
