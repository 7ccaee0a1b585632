"""Attacks D3 and D4: the machine is asleep for a while, or the process gets no time; real ones.

What the engine makes of a backlog is in ``scenarios/attacks``; here is that it gets it whole.
"""

import os
import signal
from collections.abc import Sequence
from math import inf
from pathlib import Path
from time import monotonic
from typing import Any

from mav_tasks.engine.inputs import AtOnce, Packets
from mav_tasks.recording.reading import read
from mav_tasks.recording.record_lines import input_of
from tests.kit.processes import command_long, free_udp_ports, stand, submit, wait_for, wait_until

MOVE, STOP, CONTINUE = 54000, 54003, 193
ASLEEP = 20.0  # s
STOPPED = 5.0  # s
TIMEOUT = 3.0  # s, the rover's own, of setpoints


def test_time_in_which_the_machine_was_asleep_counts(tmp_path: Path) -> None:
    """What drives is held, and the deadline of what waits has passed."""
    module = ("tests.kit.asleep", str(ASLEEP))
    with stand(tmp_path, module=module) as running:
        link = running.connect()
        running.drive(link, 50.0)
        waiting = submit(link, MOVE, 1.0)
        assert command_long(link, 54012, waiting, 3, 0.5 * ASLEEP).result == 0
        os.kill(running.server.popen.pid, signal.SIGUSR1)
        wait_for(link, "STATUSTEXT", "'held: server was late' in STATUSTEXT.text", within=2)
        running.server.wait_for(f"task {waiting} expired", within=3)
        wait_until(lambda: running.speed() < 0.01, within=5, what="the rover to stand")
        assert "Traceback" not in running.server.text


def test_what_waited_on_all_links_comes_as_a_whole_with_its_age(tmp_path: Path) -> None:
    """A continue that was sent before a STOP on another link can be told from a new one."""
    (second,) = free_udp_ports(1)
    records = tmp_path / "records"
    options = ("--record", str(records), "--client", f"udpin:127.0.0.1:{second}")
    with stand(tmp_path, *options) as running:
        link, other = running.connect(), running.heard(f"udpout:127.0.0.1:{second}", 254)
        running.drive(link, 50.0)
        server = running.server.popen.pid
        os.kill(server, signal.SIGSTOP)
        say(other, CONTINUE, 1)
        stopped_at = monotonic()
        wait_until(lambda: monotonic() > stopped_at + STOPPED, within=2 * STOPPED)
        say(link, STOP)
        os.kill(server, signal.SIGCONT)
        wait_for(link, "COMMAND_ACK", f"COMMAND_ACK.command=={STOP}")
        wait_until(lambda: running.speed() < 0.01, within=TIMEOUT, what="the rover to stand")
        running.server.end()
    (path,) = records.glob("*.decisions.gz")
    entries = [entry for entry in read(path).entries() if entry.kind == "at once"]
    inputs = [(entry.now, input_of(entry.values)) for entry in entries]
    ages = {
        command: now - arrived
        for now, item in inputs
        if isinstance(item, AtOnce)
        for packets in item.packets
        for (_, data), arrived in zip(packets.datagrams, timed(packets), strict=True)
        for command in (STOP, CONTINUE)
        if is_command(data, command)
    }
    assert STOPPED <= ages[CONTINUE] < STOPPED + 1.0
    assert ages[STOP] < 0.5


def timed(packets: Packets) -> Sequence[float]:
    """Return the arrivals of packets; those of rovers have none."""
    return packets.arrived or [inf] * len(packets.datagrams)


def say(link: Any, command: int, *params: float) -> None:
    link.mav.command_long_send(1, 191, command, 0, *params, *(0.0,) * (7 - len(params)))


def is_command(data: bytes, command: int) -> bool:
    """Whether a datagram is a COMMAND_LONG of this number."""
    return data[7] == 76 and data[10 + 28 : 10 + 30] == command.to_bytes(2, "little")
