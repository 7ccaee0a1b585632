"""Changes of a queue, row by row: who applies them knows the whole queue."""

from random import Random
from typing import Any

from mav_tasks.web.queue_rows import QueueRows


def row(number: int, *, position: int = 0, epoch: int = 1, **more: Any) -> dict[str, Any]:
    moving = {"position": position, "time_to_start": 1.0 * position, "time_to_finish": None}
    return {"id": number, "label": "x", "halt_epoch": epoch} | moving | more


def queue(*rows: dict[str, Any], epoch: int = 1) -> dict[str, Any]:
    return {"vehicle": 1, "halt_epoch": epoch, "current": None, "waiting": list(rows)}


def applied(known: dict[str, Any] | None, change: dict[str, Any]) -> dict[str, Any]:
    """Return a queue as a reader of the stream makes it of the one before and a change."""
    rows = {each["id"]: each for each in (known or {"waiting": []})["waiting"]}
    rows |= {each["id"]: each for each in change["rows"]}
    names = ("position", "time_to_start", "time_to_finish")
    waiting = [
        rows[number] | dict(zip(names, numbers, strict=True)) | {"halt_epoch": change["halt_epoch"]}
        for number, *numbers in change["order"]
    ]
    head = {name: value for name, value in change.items() if name not in ("order", "rows")}
    return head | {"waiting": waiting}


def test_only_rows_that_changed_are_sent() -> None:
    rows = QueueRows()
    first = rows.change(queue(row(1), row(2, position=1), row(3, position=2)))
    assert [each["id"] for each in first["rows"]] == [1, 2, 3]
    change = rows.change(queue(row(2), row(3, position=1, label="y"), row(4, position=2)))
    assert [each["id"] for each in change["rows"]] == [3, 4]
    assert change["order"] == [[2, 0, 0.0, None], [3, 1, 1.0, None], [4, 2, 2.0, None]]


def test_a_halt_alone_sends_no_row() -> None:
    rows = QueueRows()
    rows.change(queue(row(1), row(2, position=1)))
    change = rows.change(queue(row(1, epoch=2), row(2, position=1, epoch=2), epoch=2))
    assert (change["rows"], change["halt_epoch"]) == ([], 2)


def test_who_applies_every_change_knows_the_queue_also_from_any_snapshot_on() -> None:
    random = Random(5)
    rows, known = QueueRows(), None
    for step in range(300):
        numbers = random.sample(range(12), random.randrange(10))
        now = queue(
            *(
                row(each, position=at, epoch=step, label=random.choice("ab"))
                for at, each in enumerate(numbers)
            ),
            epoch=step,
        )
        known = applied(known, rows.change(now))
        assert known == now
        if random.random() < 0.1:
            known = rows.forms()[0]  # a stream that begins here
