import pytest

from mav_tasks.errors import Rejection
from mav_tasks.tasks.task import MAX_TASK_ID
from mav_tasks.tasks.task_ids import TaskIds


def test_a_server_counts_on_and_skips_ids_in_use() -> None:
    ids = TaskIds(7)
    assert [ids.take({8, 9}) for _ in range(3)] == [7, 10, 11]
    ids.count_from(MAX_TASK_ID)
    assert [ids.take({1}) for _ in range(2)] == [MAX_TASK_ID, 2]


def test_a_gateway_uses_only_ids_that_were_granted_each_once() -> None:
    ids = TaskIds()
    ids.share()
    with pytest.raises(Rejection, match="not granted"):
        ids.take(())
    ids.grant(1000, 2)
    ids.grant(5000, 2)
    assert [ids.take({5000}) for _ in range(3)] == [1000, 1001, 5001]
    with pytest.raises(Rejection, match="not granted"):
        ids.take(())


def test_a_granted_range_may_go_on_at_1() -> None:
    ids = TaskIds()
    ids.share()
    ids.grant(MAX_TASK_ID, 3)
    assert [ids.take(()) for _ in range(3)] == [MAX_TASK_ID, 1, 2]
