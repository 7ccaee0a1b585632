"""./tools/demo, as the README has it."""

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def demo(*options: str) -> subprocess.CompletedProcess[str]:
    """Run ./tools/demo to its end."""
    return subprocess.run(
        [str(ROOT / "tools/demo"), *options],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


@pytest.mark.slow
@pytest.mark.timeout(150)
@pytest.mark.parametrize("options", [(), ("--fast",), ("--fast", "--body", "kinematic")])
def test_the_demo_shows_three_tasks_and_finds_all_as_it_should_be(options: tuple[str, ...]) -> None:
    done = demo(*options)

    assert done.returncode == 0, done.stdout + done.stderr
    acks = re.findall(r"COMMAND_ACK ACCEPTED: (\w+) .* is task (\d+)", done.stdout)
    assert acks == [("forward", "1"), ("rotate", "2"), ("forward", "3")]
    rows = re.findall(r"│ +(\d) │ (\w+) +│ +(\d) │ +(\d) │ (\w+) ", done.stdout)
    assert rows == [
        ("1", "forward", "3", "1", "completed"),
        ("2", "rotate", "8", "2", "completed"),
        ("3", "forward", "5", "3", "completed"),
    ]
    picture = re.search(r"picture of the track: (\S+)", done.stdout)
    assert picture is not None
    assert Path(picture[1]).read_bytes().startswith(b"\x89PNG")


def test_the_window_cannot_be_had_in_virtual_time() -> None:
    done = demo("--gui", "--fast")
    assert done.returncode == 2
    assert "--gui" in done.stdout
