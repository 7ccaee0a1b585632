"""Event streams: resumed without a gap, and never held up by a slow reader."""

import asyncio
import json
from typing import Any

import pytest

from mav_tasks.web.hub import READERS, UNREAD, Hub, Reader
from tests.kit.awaited import awaited


def hub() -> Hub:
    rovers = {"vehicles": [{"vehicle": 1}, {"vehicle": 2}]}
    return Hub("a1", snapshot=lambda: {"whole": True}, vehicles=lambda: rovers)


class Stream:
    """An event stream that is read."""

    def __init__(self, reader: Reader) -> None:
        self.frames = reader.frames()


async def read(reader: Stream | Reader) -> list[tuple[str, str | None, Any]]:
    """Return what is unread: kind, id and data of each event."""
    stream = reader if isinstance(reader, Stream) else Stream(reader)
    data = await anext(stream.frames)
    events = []
    for frame in data.decode().strip().split("\n\n"):
        parts = dict(line.split(": ", 1) for line in frame.splitlines())
        events.append((parts["event"], parts.get("id"), json.loads(parts["data"])))
    return events


@awaited
async def test_a_new_reader_gets_a_snapshot_and_then_each_event() -> None:
    it = hub()
    it.publish("task", {"id": 1})
    reader = Stream(it.open(None))
    assert await read(reader) == [("snapshot", "a1-1", {"whole": True})]
    it.publish("task", {"id": 2})
    it.publish("text", {"words": "grün\nzwei"})
    assert await read(reader) == [
        ("task", "a1-2", {"id": 2}),
        ("text", "a1-3", {"words": "grün\nzwei"}),
    ]


@awaited
async def test_a_reader_that_reconnects_gets_what_it_missed() -> None:
    it = hub()
    for number in (1, 2, 3):
        it.publish("task", {"id": number})
    missed = await read(it.open("a1-1"))
    assert [event[1] for event in missed[:-1]] == ["a1-2", "a1-3"]
    assert missed[-1][0] == "vehicles"  # states of rovers are not kept: the latest of all
    assert [event[0] for event in await read(it.open("a1-3"))] == ["vehicles"]


@awaited
async def test_an_unknown_place_in_the_stream_begins_with_a_snapshot() -> None:
    it = hub()
    it.publish("task", {"id": 1})
    for last in (
        "b2-1",
        "a1-9",
        "a1-",
        "a1-x",
        "",
        "a1--1",
        "a1-٣",
        "1" * 5000,
        "a1-" + "9" * 5000,
    ):
        assert (await read(it.open(last)))[0][0] == "snapshot", last


@awaited
async def test_what_is_kept_for_reconnecting_readers_is_bounded() -> None:
    it = hub()
    for number in range(2500):
        it.publish("task", {"id": number})
    assert (await read(it.open("a1-499")))[0][0] == "snapshot"
    assert (await read(it.open("a1-500")))[0][1] == "a1-501"


@awaited
async def test_a_reader_that_does_not_read_gets_a_snapshot_later_and_delays_nobody() -> None:
    it = hub()
    slow, quick = Stream(it.open(None)), Stream(it.open(None))
    await read(slow)
    await read(quick)
    for number in range(UNREAD + 1):
        it.publish("task", {"id": number})
        assert [event[2] for event in await read(quick)] == [{"id": number}]
    assert [event[0] for event in await read(slow)] == ["snapshot"]
    it.publish("task", {"id": 7})
    assert [event[2] for event in await read(slow)] == [{"id": 7}]


@awaited
async def test_states_of_rovers_that_a_reader_missed_are_sent_as_the_latest_of_all() -> None:
    it = hub()
    reader = Stream(it.open(None))
    await read(reader)
    it.publish_vehicles({"vehicles": [{"vehicle": 1}]})
    assert await read(reader) == [("vehicles", None, {"vehicles": [{"vehicle": 1}]})]
    it.publish_vehicles({"vehicles": [{"vehicle": 1}]})
    it.publish_vehicles({"vehicles": [{"vehicle": 2}]})
    assert await read(reader) == [
        ("vehicles", None, {"vehicles": [{"vehicle": 1}, {"vehicle": 2}]})
    ]


@awaited
async def test_ended_streams_end_and_are_forgotten() -> None:
    it = hub()
    reader = Stream(it.open(None))

    async def drain() -> int:
        return len([frame async for frame in reader.frames])

    draining = asyncio.create_task(drain())
    await asyncio.sleep(0)
    assert it.readers == 1
    it.end()
    assert await draining >= 1
    assert it.readers == 0


@awaited
async def test_a_page_hears_that_a_quiet_stream_is_alive(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mav_tasks.web.hub.SILENCE", 0.0)
    it = hub()
    reader = Stream(it.open(None))
    await read(reader)
    assert await read(reader) == [("alive", None, {})]


@awaited
async def test_a_stream_whose_browser_is_gone_before_its_first_event_does_not_count() -> None:
    it = hub()
    for _ in range(3):
        it.open(None).frames()  # nobody asks for an event
    assert it.readers == 0


async def taken(reader: Reader) -> Stream:
    """Return the stream of a reader that has taken its first event."""
    stream = Stream(reader)
    await anext(stream.frames)
    return stream


async def has_ended(stream: Stream) -> bool:
    """Return whether a stream ends behind what it still gives."""
    try:
        async with asyncio.timeout(0.05):
            async for _ in stream.frames:
                pass
    except TimeoutError:
        return False
    return True


@awaited
async def test_there_is_room_for_a_user_with_few_streams_and_one_with_many_loses_its_oldest() -> (
    None
):
    it = hub()
    anna = await taken(it.open(None, user="anna"))
    eves = [await taken(it.open(None, user="eve")) for _ in range(READERS + 20)]
    late = await taken(it.open(None, user="bob"))
    assert it.readers == READERS
    assert not await has_ended(anna)
    assert not await has_ended(late)
    assert [await has_ended(each) for each in (eves[0], eves[-1])] == [True, False]


@awaited
async def test_large_events_are_kept_and_left_unread_up_to_some_bytes() -> None:
    it = hub()
    slow = await taken(it.open(None))
    for number in range(2, 102):
        it.publish("task", {"id": number, "text": "x" * 500_000})
    assert len(await anext(slow.frames)) < 1_000  # the snapshot instead of all of them
    assert (await read(it.open("a1-92")))[0][0] == "snapshot"
    assert [event[1] for event in await read(it.open("a1-95"))][:2] == ["a1-96", "a1-97"]
