"""Simulated rovers behave as the recorded ones; and a driver never drives blind."""

import asyncio
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import pytest
from pymavlink.dialects.v20 import development as mav

from mav_tasks.links.base import Link
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Encoder
from mav_tasks.mavlink.messages import Message
from mav_tasks.mavlink.packet import split_datagram
from rover_sim.check_vehicle.simulated import ROVERS, in_its_world, measure
from rover_sim.observing.driver import Driver, Interference
from rover_sim.observing.observer import Observer
from rover_sim.observing.track import Track
from tests.kit.volume import some

BOOTED = 45.0  # s

Says = Callable[[Message], Iterable[Message]]


class BrokenLink:
    """A link to a rover that says what ``voice`` makes of it."""

    def __init__(self, link: Link) -> None:
        self._link, self.voice = link, as_it_is
        self._decoder, self._encoder = Decoder(), Encoder(Address(1, 1))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._link, name)

    def receive(self, most: int) -> Iterator[tuple[Any, bytes]]:
        for peer, data in self._link.receive(most):
            message = self._decoder.decode(split_datagram(data)[0])
            assert message is not None
            for said in self.voice(message):
                yield peer, self._encoder.encode(said)


def as_it_is(message: Message) -> Iterable[Message]:
    return [message]


def gone(kind: type[Message]) -> Says:
    return lambda message: [] if isinstance(message, kind) else [message]


def with_fields(kind: type[Message], **fields: object) -> Says:
    def change(message: Message) -> list[Message]:
        if isinstance(message, kind):
            for name, value in fields.items():
                setattr(message, name, value)
        return [message]

    return change


# -- beside the real ones


@pytest.mark.slow
@pytest.mark.timeout(180)  # s; five minutes of driving are some seconds of arithmetic
def test_the_simulated_rover_is_as_unkind_as_the_real_one() -> None:
    for name in some(list(ROVERS), 0, 3):
        found = list(measure(name, seed=0))  # as the command does
        assert [(row, value) for row, value in found if not row.is_right(value)] == []
        assert len(found) > 90
        assert not any(row.is_right("another") for row, _ in found)


# -- whatever happens while it is driven


def test_it_does_not_drive_blind_nor_against_somebody() -> None:
    cases: dict[str, Says] = {
        "no heartbeat": gone(m.Heartbeat),
        "no LOCAL_POSITION_NED": gone(m.LocalPositionNed),
        "it is not armed": with_fields(m.Heartbeat, base_mode=1),
        "it left the mode": with_fields(m.Heartbeat, custom_mode=0),
    }

    async def drive(link: Link, _truth: Track) -> None:
        await asyncio.sleep(BOOTED)
        for words, says in cases.items():
            broken: Any = BrokenLink(link)
            observer = Observer(broken)
            driver = Driver(observer)
            assert await observer.found(5.0)
            await driver.ask_rates(
                20.0, mav.MAVLINK_MSG_ID_ATTITUDE, mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED
            )
            assert await driver.get_ready(3)
            await driver.stream(0.5, 1.0)
            broken.voice = says
            with pytest.raises(Interference, match=words):
                await driver.stream(0.5, 5.0)
            broken.voice = as_it_is
            assert await driver.rest()
            observer.close()

    in_its_world(ROVERS["ardupilot-skid"], 0, drive)
