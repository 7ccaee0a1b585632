"""The links to clients."""

from mav_tasks.engine.clients.gcs_side import MAX_LINK_NUMBER, GcsSide
from mav_tasks.engine.clients.signatures import Signatures
from mav_tasks.engine.inputs import LinkChanged, LinkSide
from mav_tasks.engine.timers import Timers, Turn
from mav_tasks.mavlink.codec import Packer
from mav_tasks.settings import Settings


def do_nothing(*, now: float) -> None: ...


def side(*links: str) -> GcsSide:
    made = GcsSide(
        queue=[],
        packer=Packer(),
        signatures=Signatures(window=60.0),
        statuses=Timers().timer(Turn.STATUSES, do_nothing),
        settings=Settings(),
    )
    for link in links:
        made.change_link(LinkChanged(link, LinkSide.CLIENTS, up=True), now=0.0)
    return made


def test_links_are_numbered_as_they_came_and_keep_their_number() -> None:
    gcs = side("one", "two")
    gcs.change_link(LinkChanged("one", LinkSide.CLIENTS, up=False), now=1.0)
    gcs.change_link(LinkChanged("three", LinkSide.CLIENTS, up=True), now=1.0)
    gcs.change_link(LinkChanged("one", LinkSide.CLIENTS, up=True), now=2.0)
    assert [gcs.link_numbers.get(name, 0) for name in ("one", "two", "three", "other")] == [
        1,
        2,
        3,
        0,
    ]


def test_numbers_fit_their_field() -> None:
    gcs = side(*(f"link{number}" for number in range(300)))
    assert gcs.link_numbers["link299"] == MAX_LINK_NUMBER
