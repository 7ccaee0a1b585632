"""A user's test file, as shown in sim/README.md."""

EXAMPLE = """\
import pytest
from mav_tasks import Move, TaskFailed


def test_it_drives_two_metres(task_client, rover):
    task_client.submit(Move(2.0)).done()
    assert rover.north == pytest.approx(2.0, abs=0.05)


def test_a_blocked_rover_is_no_success(task_client, rover):
    rover.block_wheels()
    with pytest.raises(TaskFailed, match="stuck"):
        task_client.submit(Move(2.0)).done()
"""
