"""When a client asks about a task of which it hears nothing, to exact times."""

from dataclasses import replace

from mav_tasks.client.values import TaskStatus, Unit
from mav_tasks.client.watch import SILENT, SILENT_WAITING, Watch
from mav_tasks.tasks.lifecycle import TaskReason, TaskState

S = TaskState

QUEUED = TaskStatus(
    id=7,
    vehicle=1,
    state=S.QUEUED,
    reason=TaskReason.NONE,
    words="",
    priority=5,
    after=0,
    nonce=99,
    command=54000,
    progress=None,
    remaining=None,
    unit=Unit.NONE,
    position=None,
    time_to_start=None,
    time_to_finish=None,
    execution_time=None,
    item=1,
    items=1,
    submitter="244/190",
    version=1,
)


def asked(watch: Watch, until: float) -> list[float]:
    """Return when a silent task is asked about; each question is given up at once."""
    times = []
    while (due := watch.next_deadline()) is not None and due <= until:
        for followed in watch.to_ask(now=due):
            times.append(due)
            assert followed.id == 7
    return times


def test_nobody_waits_so_nobody_asks() -> None:
    watch = Watch()
    watch.follow(7, 1, nonce=99, now=0.0)
    assert watch.next_deadline() is None
    assert watch.to_ask(now=100.0) == []


def test_a_task_that_waits_is_asked_about_less_and_less() -> None:
    watch = Watch()
    watch.follow(7, 1, nonce=99, now=0.0).listeners = 1
    watch.receive(QUEUED, now=0.0)
    times = asked(watch, 40.0)
    assert times == [SILENT, SILENT + 4, SILENT + 12, SILENT + 22, SILENT + 32]
    assert SILENT_WAITING == 10.0


def test_one_that_is_under_way_is_asked_about_steadily() -> None:
    watch = Watch()
    watch.follow(7, 1, nonce=99, now=0.0).listeners = 1
    watch.receive(replace(QUEUED, state=S.EXECUTING, version=2), now=0.0)
    assert asked(watch, 7.0) == [2.0, 4.0, 6.0]


def test_no_second_question_while_one_is_under_way() -> None:
    watch = Watch()
    followed = watch.follow(7, 1, nonce=99, now=0.0)
    followed.listeners, followed.is_asked = 1, True
    assert watch.next_deadline() is None
    assert watch.to_ask(now=50.0) == []


def test_news_put_the_question_off() -> None:
    watch = Watch()
    watch.follow(7, 1, nonce=99, now=0.0).listeners = 1
    watch.receive(replace(QUEUED, state=S.EXECUTING, version=2), now=1.9)
    assert watch.next_deadline() == 1.9 + SILENT


def test_a_vehicle_that_is_back_is_asked_at_once() -> None:
    watch = Watch()
    watch.follow(7, 1, nonce=99, now=0.0).listeners = 1
    watch.hurry(2, now=0.5)
    assert watch.next_deadline() == SILENT
    watch.hurry(1, now=0.5)
    assert watch.next_deadline() == 0.5


def test_what_was_overtaken_on_its_way_is_no_news() -> None:
    watch = Watch()
    followed = watch.follow(7, 1, nonce=99, now=0.0)
    watch.receive(replace(QUEUED, state=S.EXECUTING, version=3), now=0.1)
    assert watch.receive(QUEUED, now=0.2) is None
    assert followed.status is not None
    assert followed.status.state is S.EXECUTING


def test_what_is_over_stays_so_and_is_followed_no_more() -> None:
    watch = Watch()
    followed = watch.follow(7, 1, nonce=99, now=0.0)
    watch.receive(replace(QUEUED, state=S.COMPLETED, version=5), now=0.1)
    assert followed.is_over
    assert watch.get(7) is None
    assert watch.receive(replace(QUEUED, version=6), now=0.2) is None
    assert followed.status is not None
    assert followed.status.state is S.COMPLETED


def test_an_id_that_means_another_task_now_is_lost() -> None:
    for other in (replace(QUEUED, nonce=5), replace(QUEUED, command=54001, version=2)):
        watch = Watch()
        followed = watch.follow(7, 1, nonce=99, now=0.0)
        watch.receive(QUEUED, now=0.0)
        assert watch.receive(other, now=0.1) is followed
        assert followed.is_lost
        assert followed.is_over


def test_the_mark_of_a_task_of_others_is_the_first_that_is_heard() -> None:
    watch = Watch()
    followed = watch.follow(7, 1, nonce=None, now=0.0)
    watch.receive(QUEUED, now=0.0)
    assert not followed.is_lost
    watch.receive(replace(QUEUED, nonce=5), now=0.1)
    assert followed.is_lost


def test_of_several_wishes_for_a_stream_the_shortest_counts() -> None:
    watch = Watch()
    assert watch.open_stream(1, 0.5) == 0.5
    assert watch.open_stream(1, 0.2) == 0.2
    assert watch.stream_of(1) == 0.2
    assert watch.stream_of(2) is None
    assert watch.close_stream(1, 0.2) == 0.5
    assert watch.close_stream(1, 0.5) is None
    assert watch.stream_of(1) is None
