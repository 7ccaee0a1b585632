"""``serve --web``: one command that starts and ends the server and its page."""

import signal
import socket
import urllib.request
from pathlib import Path

import pytest

from tests.kit.processes import free_tcp_ports, free_udp_ports, process, wait_until

pytest.importorskip("starlette", reason="the web page's packages are missing")


@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGKILL])
def test_the_page_begins_and_ends_with_the_server(tmp_path: Path, end: signal.Signals) -> None:
    client, vehicle = free_udp_ports(2)
    (port,) = free_tcp_ports(1)
    (tmp_path / "keys.toml").touch(mode=0o600)
    with process(
        *("-m", "mav_tasks.cli", "serve", "--no-push", "--store", str(tmp_path / "tasks.sqlite3")),
        *("--client", f"udpin:127.0.0.1:{client}", "--vehicle", f"udpout:127.0.0.1:{vehicle}"),
        *("--keys", str(tmp_path / "keys.toml"), "--web", f"127.0.0.1:{port}"),
        folder=tmp_path,
        name="serve",
    ) as server:
        url = server.wait_for(r"web page: (\S+)")[1]
        with urllib.request.urlopen(url, timeout=10) as answer:
            assert answer.status == 200
        server.end(end)
        wait_until(lambda: not is_served(port), within=10, what="a page that has ended")


def is_served(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0
