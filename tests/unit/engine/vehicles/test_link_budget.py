"""What observers may ask over a vehicle's link."""

from mav_tasks.engine.vehicles.link_budget import LIST, LIST_SHARE, LinkBudget
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Packer
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.mavlink.packet import Packet, split_datagram

OBSERVER = Address(9, 190)
RADIO, WIDE = 5760.0, 1e6
LISTING = m.ParamRequestList(1, 1)
BURST = m.FileTransferProtocol(0, 1, 1, [0, 0, 0, 15] + [0] * 247)
ASKING = m.CommandLong(1, 1, MavCmd.REQUEST_MESSAGE, 0, 148, 0, 0, 0, 0, 0, 0)


def packet(message: m.Message) -> Packet:
    (found,) = split_datagram(Packer().pack(message, OBSERVER, seq=0))
    return found


def budget(capacity: float) -> LinkBudget:
    return LinkBudget(budget=50_000.0, capacity=capacity, vehicles=1, now=0.0)


def may(link: LinkBudget, message: m.Message, *, driven: bool = False, now: float = 0.0) -> bool:
    return link.why_not("client", packet(message), message, is_driven=driven, now=now) is None


def test_a_list_waits_for_a_narrow_link_until_no_task_drives() -> None:
    assert not may(budget(RADIO), LISTING, driven=True)
    assert may(budget(RADIO), LISTING)
    assert may(budget(WIDE), LISTING, driven=True)


def test_one_list_at_a_time() -> None:
    link, takes = budget(RADIO), LIST / (LIST_SHARE * RADIO)
    assert may(link, LISTING)
    assert not may(link, BURST, now=takes - 0.1)
    assert may(link, BURST, now=takes + 0.1)


def test_small_questions_have_a_rate() -> None:
    link = budget(RADIO)
    passed = sum(may(link, ASKING, now=0.01 * tick) for tick in range(6000))  # a minute
    size = 45 + 22 + 90  # the question, its ack, AUTOPILOT_VERSION
    assert 30 <= passed <= 65 * 100 / size + 5
