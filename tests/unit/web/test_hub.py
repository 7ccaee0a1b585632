"""The events that the page reads: what a reader gets, and when that is a snapshot."""

from mav_tasks.web.hub import KEPT, UNREAD, Hub
from tests.kit.awaited import awaited


@awaited
async def test_a_reader_gets_what_it_missed_or_else_a_snapshot() -> None:
    hub = Hub("x", snapshot=lambda: "all", vehicles=lambda: "rovers")
    snapshot = b'event: snapshot\ndata: "all"\n\n'
    hub.publish_vehicles("nobody reads it")
    for number in range(1, KEPT + 3):
        hub.publish("task", number)
    late, old = hub.open(f"x-{KEPT}").frames(), hub.open("x-1").frames()
    missed = await anext(late)
    assert missed.count(b"event: task") == 2
    assert missed.endswith(b'event: vehicles\ndata: "rovers"\n\n')
    assert (await anext(old)).endswith(snapshot)
    for number in range(UNREAD + 2):
        hub.publish("task", number)
    assert (await anext(late)).endswith(snapshot)
    hub.end()
    assert [await anext(each, b"") for each in (late, old)] == [b"", b""]
