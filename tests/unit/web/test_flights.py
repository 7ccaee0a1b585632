"""Halts that are requested again before they are answered share an answer that is not older."""

import asyncio

import pytest

from mav_tasks.errors import NoAnswer
from mav_tasks.web.flights import Flights
from tests.kit.awaited import awaited


class Rig:
    """Requests that are answered one after the other, when the test says so."""

    def __init__(self) -> None:
        self.flights = Flights()
        self.sent: list[asyncio.Future[None]] = []

    async def _send(self) -> None:
        self.sent.append(asyncio.get_running_loop().create_future())
        await self.sent[-1]

    async def press(self) -> asyncio.Task[None]:
        pressed = asyncio.create_task(self.flights.join("stop", self._send))
        await asyncio.sleep(0)
        return pressed


@awaited
async def test_a_flood_sends_two_requests_at_a_time_and_everybody_gets_an_answer() -> None:
    rig = Rig()
    presses = [await rig.press() for _ in range(100)]
    assert len(rig.sent) == 2
    rig.sent[0].set_result(None)
    await presses[0]
    assert not any(each.done() for each in presses[1:])  # that answer may be older than they are
    later = await rig.press()
    assert len(rig.sent) == 3
    rig.sent[1].set_result(None)
    await asyncio.gather(*presses)
    assert not later.done()
    rig.sent[2].set_result(None)
    await later
    assert repr(rig.flights) == "Flights(0 flying, 0 waiting)"


@awaited
async def test_who_shares_an_answer_shares_its_failure() -> None:
    rig = Rig()
    presses = [await rig.press() for _ in range(3)]
    rig.sent[0].set_result(None)
    rig.sent[1].set_exception(NoAnswer("gone"))
    await presses[0]
    for press in presses[1:]:
        with pytest.raises(NoAnswer):
            await press
    assert repr(rig.flights) == "Flights(0 flying, 0 waiting)"
