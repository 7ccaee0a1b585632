"""check_vehicle passes simulated rovers of each make, and names what is wrong with a broken one."""

import asyncio
import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import pytest
from pymavlink.dialects.v20 import development as mav

from mav_tasks.links.base import Link
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Encoder
from mav_tasks.mavlink.messages import Message
from mav_tasks.mavlink.packet import split_datagram
from rover_sim.check_vehicle.contract import GROUPS, check_all
from rover_sim.check_vehicle.simulated import ROVERS, Make, in_its_world, measure
from rover_sim.frames import Frame
from rover_sim.observing.driver import Driver, Interference
from rover_sim.observing.observer import Observer
from rover_sim.observing.track import Track
from tests.kit.volume import some

BOOTED = 45.0  # s
REQUEST_MESSAGE, SET_MESSAGE_INTERVAL = 512, 511
ARDUPILOT = ROVERS["ardupilot-skid"]

Says = Callable[[Message], Iterable[Message]]
Hears = Callable[[Message], Message | None]


class BrokenLink:
    """A link to a rover that says and hears what the hooks make of it."""

    def __init__(self, link: Link, says: Says, hears: Hears) -> None:
        self._link, self.voice, self.hears = link, says, hears
        self._decoder, self._encoder = Decoder(), Encoder(Address(1, 1))
        self.asked: list[Message] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._link, name)

    def send(self, peer: Any, data: bytes) -> None:
        (packet,) = split_datagram(data)
        message = self._decoder.decode(packet)
        assert message is not None
        self.asked.append(message)
        heard = self.hears(message)
        if heard is not None:
            again = Encoder(packet.source, first_seq=packet.seq).encode(heard)
            self._link.send(peer, again)

    def receive(self, most: int) -> Iterator[tuple[Any, bytes]]:
        for peer, data in self._link.receive(most):
            message = self._decoder.decode(split_datagram(data)[0])
            assert message is not None
            for said in self.voice(message):
                yield peer, self._encoder.encode(said)


def run(
    make: Make,
    groups: Iterable[str] = GROUPS,
    *,
    may_arm: bool = False,
    says: Says = lambda message: [message],
    hears: Hears = lambda message: message,
) -> tuple[dict[str, bool | None], list[Message]]:
    """Return what the checks found, by name, and all that was sent."""

    async def checked(link: Link, _truth: Track) -> tuple[dict[str, bool | None], list[Message]]:
        await asyncio.sleep(BOOTED)
        broken: Any = BrokenLink(link, says, hears)
        observer = Observer(broken, keeps=True)
        found = [each async for each in check_all(observer, may_arm=may_arm, only=tuple(groups))]
        observer.close()
        return {check.name: check.is_right(value) for check, value in found}, broken.asked

    return in_its_world(make, 0, checked)


def test_a_simulated_rover_of_each_make_passes() -> None:
    for make in (ARDUPILOT, ROVERS["px4-differential"], Make("generic", Frame.SKID, "")):
        found, _ = run(make, may_arm=True)
        assert set(found.values()) == {True}, (make, found)
        assert len(found) >= 30


def test_by_default_it_neither_arms_nor_drives() -> None:
    for make in (ARDUPILOT, ROVERS["px4-differential"]):
        found, asked = run(make)
        assert [name for name, right in found.items() if right is not True] == ["arm and disarm"]
        commands = {each.command for each in asked if isinstance(each, m.CommandLong)}
        assert commands == {REQUEST_MESSAGE, SET_MESSAGE_INTERVAL, 176, 31_999}
        setpoints = [each for each in asked if isinstance(each, m.SetPositionTargetLocalNed)]
        assert all((each.vx, each.vy) == (0.0, 0.0) for each in setpoints)


# -- broken rovers


class Fault(NamedTuple):
    """A way to be broken, and the lines that must say so: no more and no fewer, of this group."""

    group: str
    lines: str
    says: Says = lambda message: [message]
    hears: Hears = lambda message: message


def with_fields(kind: type[Message], **fields: object) -> Says:
    def change(message: Message) -> list[Message]:
        if isinstance(message, kind):
            for name, value in fields.items():
                new = value(getattr(message, name)) if callable(value) else value
                setattr(message, name, new)
        return [message]

    return change


def no_refusals(message: Message) -> list[Message]:
    silent = isinstance(message, m.CommandAck) and message.result != 0
    return [] if silent else [message]


def twice(message: Message) -> list[Message]:
    return [message, message] if isinstance(message, m.CommandAck) else [message]


def takes_commands_of_others(message: Message) -> Message:
    if isinstance(message, m.CommandLong):
        message.target_system = 1
    return message


def a_parameter_missing(message: Message) -> list[Message]:
    lost = isinstance(message, m.ParamValue) and message.param_id == "FRAME_CLASS"
    return [] if lost else [message]


FAULTS = {
    "silence instead of a refusal": Fault(
        "answers",
        "PROTOCOL_VERSION on request; AVAILABLE_MODES on request; an unknown message; "
        "an unknown command; interval of an unknown message",
        says=no_refusals,
    ),
    "acks twice": Fault("answers", "acknowledgement", says=twice),
    "obeys what is for others": Fault(
        "answers", "a command for another system", hears=takes_commands_of_others
    ),
    "degrees for radians": Fault(
        "telemetry", "ATTITUDE yaw; one heading", says=with_fields(m.Attitude, yaw=math.degrees)
    ),
    "a parameter that never comes": Fault(
        "parameters", "for QGroundControl", says=a_parameter_missing
    ),
    "a mode that is not shown": Fault(
        "modes",
        "enter HOLD; enter the control mode; SET_MODE message",
        says=with_fields(m.Heartbeat, custom_mode=0),
    ),
}


def test_what_is_wrong_is_named_and_nothing_else() -> None:
    made = Make("ardupilot", Frame.SKID, "", heading=1.0)
    for name, (group, lines, says, hears) in FAULTS.items():
        found, _ = run(made, groups=(group,), says=says, hears=hears)
        wrong = {check for check, right in found.items() if right is False}
        assert wrong == set(lines.split("; ")), name


# -- beside the real ones


@pytest.mark.slow
@pytest.mark.timeout(180)  # s; five minutes of driving are some seconds of arithmetic
def test_the_simulated_rover_is_as_unkind_as_the_real_one() -> None:
    for name in some(list(ROVERS), 0, 3):
        found = list(measure(name, seed=0))  # as the command does
        assert [(row, value) for row, value in found if not row.is_right(value)] == []
        assert len(found) > 100


# -- whatever happens while it is driven


def test_it_does_not_drive_blind_nor_against_somebody() -> None:
    def gone(kind: type[Message]) -> Says:
        return lambda message: [] if isinstance(message, kind) else [message]

    cases: dict[str, Says] = {
        "no heartbeat": gone(m.Heartbeat),
        "no LOCAL_POSITION_NED": gone(m.LocalPositionNed),
        "it is not armed": with_fields(m.Heartbeat, base_mode=1),
        "it left the mode": with_fields(m.Heartbeat, custom_mode=0),
    }

    async def drive(link: Link, _truth: Track) -> None:
        await asyncio.sleep(BOOTED)
        for words, says in cases.items():
            broken: Any = BrokenLink(link, lambda message: [message], lambda message: message)
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
            broken.voice = lambda message: [message]
            assert await driver.rest()
            observer.close()

    in_its_world(ARDUPILOT, 0, drive)
