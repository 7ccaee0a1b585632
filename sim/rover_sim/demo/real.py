"""The demonstration in real time: server and rover are separate processes, connected by UDP."""

import csv
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

os.environ["MAVLINK20"] = "1"  # pymavlink's switch, read when it is imported

from pymavlink import mavutil

from rover_sim.demo.page import open_browser, page, stay
from rover_sim.demo.processes import free_ports, process
from rover_sim.demo.screen import Screen
from rover_sim.demo.third_party import Place, ThirdParty

TIME_LIMIT = 85.0  # s, for everything
REFRESH = 0.2  # s


def drive(
    screen: Screen, *, body: str, gui: bool, seed: int, record: str, web: bool
) -> tuple[ThirdParty, list[Place]]:
    """Run server, rover and third party; return the third party and the true track.

    ``web``: serve the web page, too, and go on with it until Ctrl-C.
    """
    with tempfile.TemporaryDirectory(prefix="mav-tasks-demo-") as folder:
        truth_file = Path(folder) / "truth.csv"
        rover_port, client_port = free_ports(2)
        rover = [sys.executable, "-m", "rover_sim", "--port", str(rover_port), "--body", body]
        rover += ["--truth", str(truth_file)]
        rover += ["--seed", str(seed), "--friction-variation", "0.3"] if seed else []
        rover += ["--gui"] if gui else []
        server = [sys.executable, "-m", "mav_tasks.cli", "serve", "--config", ""]
        server += ["--client", f"udpin:127.0.0.1:{client_port}"]
        store = str(Path(folder) / "demo.sqlite3") if web else ":memory:"
        server += ["--vehicle", f"udpout:127.0.0.1:{rover_port}", "--store", store]
        server += ["--record", record] if record else []
        with (
            process(rover, Path(folder) / "rover.log") as check_rover,
            process(server, Path(folder) / "server.log") as check_server,
        ):
            screen.say(f"rover: {body} body on UDP {rover_port}; server on UDP {client_port}")
            screen.say("a QGroundControl on this machine will see the rover")
            checks = (check_rover, check_server)
            if not web:
                return _watch(screen, client_port, truth_file, checks), read_track(truth_file)
            with page(f"udpout:127.0.0.1:{client_port}", store, Path(folder)) as (url, check_page):
                screen.say(f"web page: {url}")
                open_browser(url)
                party = _watch(screen, client_port, truth_file, (*checks, check_page))
                screen.say("the rover, the server and the page go on: press Ctrl-C to end them")
                stay((*checks, check_page))
                return party, read_track(truth_file)


def _watch(
    screen: Screen, port: int, truth_file: Path, checks: tuple[Callable[[], None], ...]
) -> ThirdParty:
    link = mavutil.mavlink_connection(f"udpout:127.0.0.1:{port}", source_system=255)
    try:
        party = ThirdParty(link.mav, lambda: read_track(truth_file)[-1], screen.say)
        end = time.monotonic() + TIME_LIMIT
        next_refresh = 0.0
        while not party.is_over:
            now = time.monotonic()
            if now > end:
                screen.say(f"gave up after {TIME_LIMIT:.0f} s")
                break
            party.step(now)
            message = link.recv_match(blocking=True, timeout=0.1)
            if message is not None:
                party.take(message)
            if now >= next_refresh:
                next_refresh = now + REFRESH
                screen.update(party)
                for check in checks:
                    check()
        screen.update(party)
        return party
    finally:
        link.close()


def read_track(truth_file: Path) -> list[Place]:
    """Return the true poses that the rover has written so far, without an incomplete last line."""
    text = truth_file.read_text(encoding="ascii") if truth_file.exists() else ""
    rows = csv.DictReader(text[: text.rfind("\n") + 1].splitlines())
    return [Place(float(r["north"]), float(r["east"]), float(r["yaw"])) for r in rows]
