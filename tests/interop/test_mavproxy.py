"""The real MAVProxy (PyPI), unmodified, drives a rover through the server from its command line."""

import re
from itertools import pairwise
from math import isclose
from pathlib import Path

import pytest

from mav_tasks.config.parameter_table import PARAMETERS
from tests.kit.mavproxy import Logged, MavProxy, mavproxy
from tests.kit.processes import Stand, stand, wait_until

pytestmark = [pytest.mark.interop, pytest.mark.slow, pytest.mark.timeout(240)]

HOME = (-35.363262, 149.165237)
METRE = 9e-6  # degrees of latitude, about
SOUTH, NORTH = -35.3637, -35.3628
WEST, EAST = 149.1648, 149.1657
WAYPOINT, FENCE_CORNER, RALLY_POINT = 16, 5001, 5100
OUR_DIALECT = range(54000, 54050)  # the ids of its messages
# within some centimetres and a degree: its estimate is as good as a real one's
PLACE = r"lat : -3536326[12]\d, lon : 14916523[67]\d, .*hdg : (1?\d{1,2}|359\d\d)\b"
TASK_SHOWN = r"COMMAND_ACK \{command : %d, result : 0, .*result_param2 : (\d+),"


def test_an_ardupilot_rover(tmp_path: Path) -> None:
    with (
        stand(tmp_path) as running,
        mavproxy(running.client_port, tmp_path, "--target-system", "1") as it,
    ):
        connect(it)
        telemetry(it)
        parameters(it)
        parameters_of_the_server(it)
        assert it.complaints() == []
        assert it.link()["lost"] == "0"
        restart(it)
        arm(it)
        stop(it, running)
        plans(it, tmp_path)
        mission(it, running)
        tasks(it, running)
        places(it, running)
        ending(it)
        assert it.complaints(but="AP: .* fence|DO_REPOSITION: DENIED") == []
        assert_nothing_lost(it, restarts=1)


def test_a_px4_rover(tmp_path: Path) -> None:
    """Its modes by number, and the tasks' texts not shown: see tests/kit/mavproxy.py."""
    with (
        stand(tmp_path, persona="px4") as running,
        mavproxy(running.client_port, tmp_path) as it,
    ):
        connect(it)
        it.ask("status GLOBAL_POSITION_INT", PLACE)
        change(it, "COM_OF_LOSS_T", 1.5)
        change(it, "COM_FLTMODE1", -7)  # an integer, whose bytes are in the place of a float
        it.ask("long DO_SET_MODE 1 4 3", "DO_SET_MODE: ACCEPTED")
        it.ask("arm throttle", "COMPONENT_ARM_DISARM: ACCEPTED")
        it.wait_for("^ARMED")
        assert it.ask("long 54000 20 0 0 0 0 0 nan", TASK_SHOWN % 54000)[1] == "1"
        running.server.wait_for("rover 1: task 1 submitted: move 20 m, priority 5")
        wait_until(lambda: running.speed() > 0.3, within=10, what="the rover at speed")
        it.ask("long 54003", TASK_SHOWN % 54003)
        running.server.wait_for("task 1 killed: STOP")
        it.ask("resume", "DO_PAUSE_CONTINUE: ACCEPTED")
        load(it, "wp", [(3, WAYPOINT, 0.0, *place) for place in PLACES], tmp_path)
        it.ask("long DO_SET_MODE 1 4 4", "DO_SET_MODE: ACCEPTED")
        it.wait_for("waypoint 1", within=15)
        running.server.wait_for("task 2 completed")
        assert place(running) == pytest.approx((2.0, 0.0), abs=0.4)
        lat, lon = PLACES[1]
        it.ask(f"guided {lat + METRE} {lon} 0", "DO_REPOSITION: ACCEPTED")
        running.server.wait_for(r"rover 1: task (\d) submitted: go to(.|\n)*task \1 executing")
        it.ask("disarm", "COMPONENT_ARM_DISARM: ACCEPTED")
        it.wait_for("^DISARMED")
        assert it.complaints(but="fence breach") == []
        assert_nothing_lost(it)


def connect(it: MavProxy) -> None:
    it.wait_for(rf"Received (?!{len(PARAMETERS)} )\d+ parameters", within=15)  # the rover's
    it.wait_for("Detected vehicle 1:1 on")
    it.wait_for("Detected vehicle 1:191 on")


def assert_nothing_lost(it: MavProxy, *, restarts: int = 0) -> None:
    """By its own count, by the log that it writes, and nothing in it that it cannot read.

    At each of its ``restarts`` the rover counts from 0 again: MAVProxy takes that for a loss.
    """
    link = it.link()
    count = int(link["packets"])
    it.type("set flushlogs True")
    wait_until(lambda: len(it.heard()) >= count, within=5, what="the log")
    heard = it.heard()[:count]
    assert link["state"] == "OK"
    of_rover, of_server = (gaps(heard, component_id) for component_id in (1, 191))
    assert not of_server
    assert len(of_rover) <= restarts
    assert not [packet for packet in heard if packet.message_id in OUR_DIALECT]
    assert int(link["lost"]) == sum(of_rover)


def gaps(heard: list[Logged], component_id: int) -> list[int]:
    """How many numbers are left out between a component's packets, each time that some are."""
    numbers = [p.seq for p in heard if (p.system_id, p.component_id) == (1, component_id)]
    assert len(numbers) > 10
    left_out = ((late - early - 1) % 256 for early, late in pairwise(numbers))
    return [gap for gap in left_out if gap]


def telemetry(it: MavProxy) -> None:
    it.ask("mode", "Available modes: .* STEERING, HOLD")  # those of an ArduPilot rover
    it.ask("status GLOBAL_POSITION_INT", PLACE)
    it.ask("status HOME_POSITION", r"latitude : -3536326[12]\d, longitude : 14916523[67]\d")


def parameters(it: MavProxy) -> None:
    assert shown(it, "WP_SPEED") == 5.0
    change(it, "WP_SPEED", 3.0)
    it.ask("param fetch WP_SPEED", r"WP_SPEED = 3\.0")
    it.ask("param fetch", r"Received \d+ parameters")
    assert shown(it, "WP_SPEED") == 3.0


def parameters_of_the_server(it: MavProxy) -> None:
    """The same commands, once its component is chosen."""
    it.ask("vehicle 1:191", "Set vehicle 1:191")
    it.ask("param fetch", r"Requested parameter list \(ftp\)")
    it.ask("param fetch", r"Requested parameter list$")  # that was refused meanwhile
    it.wait_for(rf"Received {len(PARAMETERS)} parameters")
    assert shown(it, "TSK_SPEED") == 0.5
    change(it, "TSK_SPEED", 0.8)
    it.ask("param fetch TSK_SPEED", r"TSK_SPEED = 0\.8")
    it.ask("vehicle 1:0", "Set vehicle 1:0")
    it.ask("param show WP_SPEED", "^WP_SPEED")


def shown(it: MavProxy, name: str) -> float:
    """What it has as the value of a parameter."""
    return float(it.ask(f"param show {name}", rf"^{name} +(\S+)$")[1])


def change(it: MavProxy, name: str, value: float) -> None:
    """Set a parameter: sent a moment later, and shown once the rover has confirmed it."""
    it.type(f"param set {name} {value:g}")
    wait_until(lambda: isclose(shown(it, name), value, rel_tol=1e-6), within=5, what=name)


def restart(it: MavProxy) -> None:
    it.ask("reboot", "PREFLIGHT_REBOOT_SHUTDOWN: ACCEPTED")
    it.wait_for("AP: Rover 1 restarted")
    it.wait_for_mode("MANUAL")
    it.ask("mode GUIDED", "DO_SET_MODE: ACCEPTED")
    it.wait_for_mode("GUIDED")


def arm(it: MavProxy) -> None:
    it.ask("mode HOLD", "DO_SET_MODE: ACCEPTED")
    it.wait_for_mode("HOLD")
    it.ask("arm throttle", "COMPONENT_ARM_DISARM: ACCEPTED")
    it.wait_for("^ARMED")


def stop(it: MavProxy, running: Stand) -> None:
    it.ask("setspeed 1.5", "DO_CHANGE_SPEED: ACCEPTED")
    assert it.ask("long 54000 20", TASK_SHOWN % 54000)[1] == "1"
    wait_until(lambda: running.speed() > 0.3, within=10, what="the rover at speed")
    it.ask("long 54003", TASK_SHOWN % 54003)
    it.wait_for("AP: Task 1 stopped for good")
    it.wait_for_mode("HOLD")
    wait_until(lambda: running.speed() < 0.05, within=10, what="the rover standing")
    it.ask("resume", "DO_PAUSE_CONTINUE: ACCEPTED")


def plans(it: MavProxy, folder: Path) -> None:
    way = [(0, WAYPOINT, 0.0, *HOME), *((3, WAYPOINT, 0.0, *place) for place in PLACES)]
    load(it, "wp", way, folder)
    told = "AP: Task 2 ready to start: plan of 2 items"
    wait_until(lambda: told in it.text, within=10, what=told)
    it.ask("wp set 2", "DO_SET_MISSION_CURRENT: ACCEPTED")
    it.wait_for("waypoint 2")
    it.ask("wp set 1", "waypoint 1")
    corners = [(SOUTH, WEST), (SOUTH, EAST), (NORTH, EAST), (NORTH, WEST)]
    load(it, "fence", [(3, FENCE_CORNER, 4.0, *corner) for corner in corners], folder)
    load(it, "rally", [(3, RALLY_POINT, 0.0, *HOME)], folder)


ARRIVES = 40.0  # s; the rover is as far away as it was driven until MAVProxy asked for STOP
#: 1 m and 2 m north
PLACES = [(round(HOME[0] + metres * METRE, 6), HOME[1]) for metres in (1, 2)]


def load(
    it: MavProxy, plan: str, items: list[tuple[int, int, float, float, float]], folder: Path
) -> None:
    """Upload a file of the QGC WPL 110 format, and find it in the list that is downloaded."""
    lines = [
        f"{seq}\t{int(seq == 0)}\t{frame}\t{command}\t{first}\t0\t0\t0\t{lat}\t{lon}\t0\t1\n"
        for seq, (frame, command, first, lat, lon) in enumerate(items)
    ]
    file = folder / f"{plan}.txt"
    file.write_text("".join(["QGC WPL 110\n", *lines]), encoding="ascii")
    it.ask(f"{plan} load {file}", rf"Sent all {len(items)} ")
    it.wait_for(r"Got MISSION_ACK: TYPE_\w+: ACCEPTED")
    it.ask(f"{plan} list", rf"Saved {len(items)} ")
    listed = re.findall(r"^(\d+) (\d) (-[\d.]+) ([\d.]+) .* p1=([\d.]+) ", it.answer, re.MULTILINE)
    for item, (frame, command, first, lat, lon) in zip(listed, items, strict=True):
        expected = (command, frame, lat, lon, first)
        assert tuple(map(float, item)) == pytest.approx(expected, rel=0, abs=2e-7)


def mission(it: MavProxy, running: Stand) -> None:
    it.ask("mode AUTO", "DO_SET_MODE: ACCEPTED")
    it.wait_for("AUTO> ")
    it.wait_for("AP: Task 2 started")
    it.wait_for("waypoint 2", within=ARRIVES)
    it.wait_for("AP: Task 2 done", within=ARRIVES)
    assert place(running) == pytest.approx((2.0, 0.0), abs=0.3)


def tasks(it: MavProxy, running: Stand) -> None:
    assert it.ask("long 54000 0.6 0 0 0 0 0 8", TASK_SHOWN % 54000)[1] == "3"
    it.wait_for("AP: Task 3 started")
    it.ask("pause", "DO_PAUSE_CONTINUE: ACCEPTED")
    it.wait_for("AP: Task 3 paused by")
    it.ask("long DO_PAUSE_CONTINUE 1", "DO_PAUSE_CONTINUE: ACCEPTED")
    it.wait_for("AP: Task 3 done", within=ARRIVES)
    assert place(running) == pytest.approx((2.6, 0.0), abs=0.3)


def places(it: MavProxy, running: Stand) -> None:
    lat, lon = PLACES[1]
    it.ask(f"guided {lat + METRE} {lon} 0", "DO_REPOSITION: ACCEPTED")
    it.wait_for("AP: Task 4 queued: go to")
    it.wait_for("AP: Task 4 done", within=ARRIVES)
    assert place(running) == pytest.approx((3.0, 0.0), abs=0.3)
    it.ask(f"guided {NORTH + METRE} {lon} 0", "DO_REPOSITION: DENIED")
    it.wait_for("AP: .* fence")
    it.ask("mode RTL", "RTL> ")
    it.wait_for("AP: Task 5 starts now: return home")
    it.wait_for("AP: Task 5 started")
    it.ask("mode HOLD", "AP: Task 5 paused by 255/230")
    it.wait_for_mode("HOLD")


def ending(it: MavProxy) -> None:
    for plan, items in (("wp", "MISSION"), ("fence", "FENCE"), ("rally", "RALLY")):
        it.ask(f"{plan} clear", f"Got MISSION_ACK: TYPE_{items}: ACCEPTED")
        it.ask(f"{plan} list", "Requesting 0 ")
    it.ask("disarm", "COMPONENT_ARM_DISARM: ACCEPTED")
    it.wait_for("^DISARMED")


def place(running: Stand) -> tuple[float, float]:
    """Where the rover truly is, m north and east of its start."""
    first, last = running.truth()[0], running.truth()[-1]
    return last["north"] - first["north"], last["east"] - first["east"]
