"""What the bench of turns measures is what it says, and the same in each run."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[3]
CHILD = ROOT / "tools" / "bench" / "turn_child.py"


@pytest.fixture(scope="module")
def answers() -> list[Any]:
    ended = subprocess.run(
        [sys.executable, "-P", str(CHILD)],
        input="calls\ncalls\ncpu 1\n",
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    return [json.loads(line) for line in ended.stdout.splitlines()]


@pytest.mark.patches_core
def test_a_turn_is_a_submission_that_is_queued_and_answered(answers: list[Any]) -> None:
    turn = answers[1]["turn"]
    assert turn["packets"] == ["COMMAND_ACK", "STATUSTEXT", "TASK_STATUS"]
    assert turn["python"]["engine/engine.py:Engine.handle"] == 2  # the packet, and the commit
    assert turn["python"]["engine/engine.py:Engine.take_packets"] == 2


def test_calls_are_the_same_in_each_run(answers: list[Any]) -> None:
    ready, once, again, seconds = answers
    assert once == again
    assert ready == "ready"
    assert 0 < seconds < 0.1


def test_only_what_is_measured_is_counted(answers: list[Any]) -> None:
    for said in (answers[1]["turn"], *answers[1]["wake_ups"]):
        assert not [name for name in said["python"] if "turn_child" in name]
        assert "setprofile" not in said["c"]


def test_idle_wake_ups_are_those_of_a_server_that_has_nothing_to_do(answers: list[Any]) -> None:
    wake_ups = answers[1]["wake_ups"]
    assert 10 <= len(wake_ups) <= 50  # in 10 s
    packets = {name for each in wake_ups for name in each["packets"]}
    assert packets <= {"HEARTBEAT", "MISSION_CURRENT", "COMMAND_LONG", "TIMESYNC"}
