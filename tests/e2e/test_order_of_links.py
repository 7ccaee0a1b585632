"""Fault C1 over real sockets: much to read on one link makes nothing newer that came on another."""

import os
import signal
from pathlib import Path
from time import sleep

import pytest

from tests.e2e.test_attacks_late import CONTINUE, say
from tests.kit.processes import free_tcp_ports, free_udp_ports, stand, wait_for, wait_until

MANY = 40  # requests before the pause: more than 1 ms of work


@pytest.mark.parametrize("kind", ["udp", "tcp"])
def test_a_continue_of_another_link_undoes_no_newer_pause(tmp_path: Path, kind: str) -> None:
    (port,) = free_tcp_ports(1) if kind == "tcp" else free_udp_ports(1)
    with stand(tmp_path, "--client", f"{kind}in:127.0.0.1:{port}") as running:
        link = running.connect()
        other = running.heard(f"{'tcp' if kind == 'tcp' else 'udpout'}:127.0.0.1:{port}", 254)
        running.drive(link, 50.0)
        say(link, CONTINUE, 0)
        wait_until(lambda: running.speed() < 0.01, within=5, what="the rover to stand")
        server = running.server.popen.pid
        os.kill(server, signal.SIGSTOP)
        for number in range(MANY):  # this link is ready first, and read first
            link.mav.command_long_send(1, 191, 512, 0, 148, number, 0, 0, 0, 0, 0)
        say(other, CONTINUE, 1)
        say(link, CONTINUE, 0)
        os.kill(server, signal.SIGCONT)
        for each in (link, other):
            wait_for(each, "COMMAND_ACK", f"COMMAND_ACK.command=={CONTINUE}")
        before = running.truth()[-1]
        sleep(1.5)
        after = running.truth()[-1]
        assert abs(after["north"] - before["north"]) + abs(after["east"] - before["east"]) < 0.05
        assert running.speed() < 0.01
