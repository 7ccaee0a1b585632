"""MAVProxy, a MAVSDK script and plain pymavlink at once on one rover: each gets what it asks for,
and no answer to another's question; all see the same rover.
"""

import json
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.kit.mavproxy import MavProxy, mavproxy
from tests.kit.processes import STOP_LIMIT, Stand, command_long, stand, submit, wait_until
from tests.kit.scripts import ROOT

pytestmark = [pytest.mark.interop, pytest.mark.slow, pytest.mark.timeout(90)]

ATTITUDE, POSITION = 30, 33
NAMES = {ATTITUDE: "ATTITUDE", POSITION: "GLOBAL_POSITION_INT"}
TASK_MOVE, TASK_STOP, SET_INTERVAL = 54000, 54003, 511
ACCEPTED, DENIED = 0, 2
#: Hz of each message for each client
WISHES = {
    "MAVProxy": {ATTITUDE: 4.0, POSITION: 4.0},
    "MAVSDK": {ATTITUDE: 20.0, POSITION: 10.0},
    "pymavlink": {ATTITUDE: 2.0, POSITION: 1.0},
}
MEASURED = 5.0  # s
HOLD = 4  # ArduPilot's number
ARMED = 128
START = -35.363262  # degrees of latitude
METRES = 111_318.85  # a degree of latitude


class Script:
    """The MAVSDK script, a process of its own: see ``tests/interop/scripts/one_of_three.py``."""

    def __init__(self, popen: subprocess.Popen[str]) -> None:
        self._popen = popen

    def tell(self, line: str) -> None:
        assert self._popen.stdin is not None
        self._popen.stdin.write(f"{line}\n")
        self._popen.stdin.flush()

    def hear(self) -> Any:
        """Return its answer; MAVSDK's own lines are passed over."""
        assert self._popen.stdout is not None
        for line in self._popen.stdout:
            if line[0] in '"{':
                return json.loads(line)
        raise AssertionError("it has ended")

    def ask(self, line: str) -> Any:
        self.tell(line)
        return self.hear()


@contextmanager
def script(port: int) -> Iterator[Script]:
    """Run it while the block runs."""
    module = "tests.interop.scripts.one_of_three"
    with subprocess.Popen(
        [sys.executable, "-X", "faulthandler", "-m", module, f"udpout://127.0.0.1:{port}"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    ) as popen:
        try:
            yield Script(popen)
            assert popen.stdin is not None
            popen.stdin.close()
            assert popen.wait(STOP_LIMIT) == 0
        finally:
            popen.kill()


class Plain:
    """Stock pymavlink, and all that it was sent."""

    def __init__(self, running: Stand) -> None:
        self.link = running.connect(source_system=200)
        self.messages: list[Any] = []
        self.link.message_hooks.append(lambda _, message: self.messages.append(message))

    def listen(self) -> None:
        """Take in what has come."""
        while self.link.recv_match(blocking=False) is not None:
            pass

    def of(self, kind: str) -> list[Any]:
        self.listen()
        return [message for message in self.messages if message.get_type() == kind]

    def texts(self) -> list[str]:
        return [message.text for message in self.of("STATUSTEXT")]


def test_each_has_its_own_and_all_see_the_same(tmp_path: Path) -> None:
    with (
        stand(tmp_path) as running,
        mavproxy(running.client_port, tmp_path, "--target-system", "1") as prompt,
        script(running.client_port) as mavsdk,
    ):
        plain = Plain(running)
        assert mavsdk.hear() == "ready"
        prompt.wait_for(r"Received \d+ parameters\n.*mav\.parm", within=15)
        rates(prompt, mavsdk, plain)
        upload(prompt, mavsdk, plain, tmp_path)
        acks(prompt, mavsdk, plain)
        drive(prompt, mavsdk, plain, running)
        assert prompt.complaints() == []


def rates(prompt: MavProxy, mavsdk: Script, plain: Plain) -> None:
    """MAVProxy asks for data streams, again and again; the others for message intervals."""
    prompt.type("set flushlogs True")
    mavsdk.ask("rates {ATTITUDE} {POSITION}".format_map(by_name(WISHES["MAVSDK"])))
    for message_id, rate in WISHES["pymavlink"].items():
        ack = command_long(plain.link, SET_INTERVAL, message_id, 1e6 / rate, target=(1, 1))
        assert ack.result == ACCEPTED
    time.sleep(1)  # until the rover sends as often as that
    began, before = time.monotonic(), counts(prompt, mavsdk, plain)
    time.sleep(MEASURED)
    after, seconds = counts(prompt, mavsdk, plain), time.monotonic() - began
    for client, wishes in WISHES.items():
        for message_id, rate in wishes.items():
            came = (after[client][message_id] - before[client][message_id]) / seconds
            assert came == pytest.approx(rate, rel=0.3), (client, NAMES[message_id])


def by_name(wishes: dict[int, float]) -> dict[str, float]:
    return {"ATTITUDE": wishes[ATTITUDE], "POSITION": wishes[POSITION]}


def counts(prompt: MavProxy, mavsdk: Script, plain: Plain) -> dict[str, dict[int, int]]:
    """How many of each message have come, by client."""
    logged = [packet.message_id for packet in prompt.heard()]
    seen = mavsdk.ask("seen")["counts"]
    return {
        "MAVProxy": {id_: logged.count(id_) for id_ in NAMES},
        "MAVSDK": {id_: seen[name] for id_, name in NAMES.items()},
        "pymavlink": {id_: len(plain.of(name)) for id_, name in NAMES.items()},
    }


def upload(prompt: MavProxy, mavsdk: Script, plain: Plain, folder: Path) -> None:
    """A plan of MAVProxy's is its affair, but what it makes of the mission is everybody's."""
    file = folder / "way.txt"
    file.write_text(
        "QGC WPL 110\n"
        "0\t1\t0\t16\t0\t0\t0\t0\t-35.363262\t149.165237\t584\t1\n"
        "1\t0\t3\t16\t0\t0\t0\t0\t-35.363253\t149.165237\t0\t1\n",
        encoding="ascii",
    )
    prompt.ask(f"wp load {file}", "Got MISSION_ACK: TYPE_MISSION: ACCEPTED")
    prompt.wait_for("AP: Task 1 ready to start")

    def totals() -> tuple[int, int]:
        of_mavsdk, of_plain = mavsdk.ask("seen")["MISSION_CURRENT"], plain.of("MISSION_CURRENT")
        return of_mavsdk[-1]["total"], of_plain[-1].total

    wait_until(lambda: totals() == (2, 2), within=5, what="MISSION_CURRENT of the plan")
    prompt.ask("status MISSION_CURRENT", "total : 2,")
    seen = mavsdk.ask("seen")
    for kind in ("MISSION_ACK", "MISSION_REQUEST", "MISSION_REQUEST_INT"):
        assert seen[kind] == plain.of(kind) == []


def acks(prompt: MavProxy, mavsdk: Script, plain: Plain) -> None:
    """Three commands of one number in the same moment: accepted, refused, accepted."""
    before = len(plain.of("COMMAND_ACK")), len(mavsdk.ask("seen")["COMMAND_ACK"])
    mavsdk.tell("move 1e9")
    plain.link.mav.command_long_send(1, 191, TASK_MOVE, 0, 0.3, 0, 0, 0, 0, 0, 8)
    prompt.ask("long 54000 0.4 0 0 0 0 0 8", "command : 54000")
    assert mavsdk.hear()["result"] == DENIED
    for task_id in (2, 3):
        wait_until_all_are_told(f"Task {task_id} done", prompt, mavsdk, plain)
    seen = mavsdk.ask("seen")
    assert [ack["result"] for ack in seen["COMMAND_ACK"][before[1] :]] == [DENIED]
    (of_plain,) = plain.of("COMMAND_ACK")[before[0] :]
    shown = re.findall(r"COMMAND_ACK \{.* result : (\d+), .*result_param2 : (\d+)", prompt.text)
    assert of_plain.result == ACCEPTED
    assert sorted([*shown, ("0", str(of_plain.result_param2))]) == [("0", "2"), ("0", "3")]


def wait_until_all_are_told(text: str, prompt: MavProxy, mavsdk: Script, plain: Plain) -> None:
    prompt.wait_for(f"AP: {text}", within=15)
    wait_until(lambda: text in mavsdk.ask("seen")["texts"], within=5, what=f"{text} in MAVSDK")
    wait_until(lambda: text in plain.texts(), within=5, what=f"{text} in pymavlink")


def drive(prompt: MavProxy, mavsdk: Script, plain: Plain, running: Stand) -> None:
    """They see it drive where it is, and stop; one of them has started it, another stops it."""
    prompt.ask("long 54000 20", "result : 0")
    wait_until(lambda: running.speed() > 0.3, within=10, what="the rover at speed")
    shown = prompt.ask("status GLOBAL_POSITION_INT", r"lat : (-\d+)")[1]
    latitudes = {
        "MAVProxy": int(shown) / 1e7,
        "MAVSDK": mavsdk.ask("seen")["latitude"],
        "pymavlink": plain.of("GLOBAL_POSITION_INT")[-1].lat / 1e7,
    }
    truth = running.truth()
    for client, latitude in latitudes.items():
        north = (latitude - START) * METRES
        old = 1.3 / WISHES[client][POSITION] + 0.5  # s
        assert truth[-1]["north"] - old * running.speed() - 0.1 < north
        assert north < truth[-1]["north"] + 0.1
    submit(plain.link, TASK_STOP)
    wait_until_all_are_told("Task 4 stopped for good by 200/0", prompt, mavsdk, plain)
    prompt.wait_for_mode("HOLD")
    wait_until(lambda: running.speed() < 0.01, within=10, what="the rover standing")

    def all_see_the_same() -> bool:
        seen, beats = mavsdk.ask("seen"), plain.of("HEARTBEAT")
        beat = next(b for b in reversed(beats) if b.get_srcComponent() == 1)
        shown = prompt.ask("status GLOBAL_POSITION_INT", r"lat : (-\d+)")[1]
        place = plain.of("GLOBAL_POSITION_INT")[-1].lat
        return (
            (seen["mode"], seen["armed"]) == ("HOLD", True)
            and (beat.custom_mode, bool(beat.base_mode & ARMED)) == (HOLD, True)
            and place == int(shown) == round(seen["latitude"] * 1e7)
        )

    wait_until(all_see_the_same, within=5, what=lambda: f"{mavsdk.ask('seen')}\n{prompt.text}")
    # between two tasks it may have been disarmed; after STOP it is not
    assert re.findall(r"^(ARMED|DISARMED)$", prompt.text, re.MULTILINE)[-1] == "ARMED"
