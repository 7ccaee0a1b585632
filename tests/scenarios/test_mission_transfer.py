"""Plans on their way over a bad net: they arrive whole or not at all, and never two in one."""

from collections import Counter
from collections.abc import Sequence
from math import nan
from random import Random

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.links.memory import Conditions
from tests.kit.cases import for_each
from tests.kit.mission import TIMEOUT, Download, Item, Upload
from tests.kit.quiet import QuietWorld
from tests.kit.volume import tries
from tests.kit.world import World, at
from tests.scenarios.conftest import MakeWorld

WAYPOINT, SPEED = 16, 178
AUTOPILOT, SERVER = (1, 1), (1, 191)
GOOD = Conditions()
#: what a client makes of a plan that is there; the last: of an ack, asked late for an earlier item
ENDS = {0: "done", TIMEOUT: "not acknowledged in time", 1: "acknowledged too early"}
LONGEST_UPLOAD = 600  # s of virtual time
SETTLED = 3.0  # s, longer than the server waits for an item

SEEDS = tries(30, long=1000)


def bad_net(random: Random, *, loss: float) -> Conditions:
    """A net that loses, doubles, delays and puts out of order."""
    return Conditions(
        delay=random.uniform(0.001, 0.03),
        jitter=random.choice([0.0, 0.02, 0.1]),
        loss=loss,
        duplication=random.choice([0.0, 0.05, 0.3]),
    )


def survey(random: Random, count: int, *, number: int = 0) -> list[Item]:
    """Return a plan of which no item equals another, nor any of a plan with another ``number``."""
    items = [Item(WAYPOINT, frame=0, current=1, **at(number, 0))]
    for seq in range(1, count):
        if random.random() < 0.1:
            speed = random.uniform(0.3, 1.5)
            items.append(Item(SPEED, x=seq, param1=1, param2=speed, param3=-1, frame=2, z=number))
        else:
            items.append(
                Item(
                    WAYPOINT,
                    **at(seq / 10, number),
                    param1=random.choice([0.0, 0.5, random.random()]),
                    param2=random.uniform(0.1, 3.0),
                    param4=random.choice([nan, random.uniform(-180, 180)]),
                    z=random.uniform(-10, 10),
                    frame=random.choice([0, 3, 5, 6, 11]),
                )
            )
    return items


def payloads(items: Sequence[Item]) -> list[bytes]:
    """Return what a client that downloads these is sent, bit by bit."""
    mav = common.MAVLink(None, 1, 1)
    return [payload(item.message(seq, 0, (255, 190)), mav) for seq, item in enumerate(items)]


def payload(message: common.MAVLink_message, mav: common.MAVLink) -> bytes:
    raw: bytes = message.pack(mav)
    return raw[10 : 10 + raw[1]]


def uploaded(world: World | QuietWorld, items: Sequence[Item], target: tuple[int, int]) -> Upload:
    upload = Upload(world.client, items, target=target)
    world.until(lambda: upload.result is not None, within=LONGEST_UPLOAD)
    return upload


def downloaded(world: World | QuietWorld, target: tuple[int, int] = AUTOPILOT) -> list[bytes]:
    download = ended_download(world, target)
    assert download.is_done, f"seed {world.seed}: {len(download.items)} of {download.count}"
    return received(download)


def ended_download(world: World | QuietWorld, target: tuple[int, int]) -> Download:
    download = Download(world.client, target=target)
    world.until(lambda: download.is_done or download.has_failed, within=LONGEST_UPLOAD)
    return download


def received(download: Download) -> list[bytes]:
    mav = common.MAVLink(None, 1, 1)
    return [payload(message, mav) for message in download.items]


# whole


@for_each("target", [AUTOPILOT, SERVER])
def test_5000_items_go_up_and_come_back(make_world: MakeWorld, target: tuple[int, int]) -> None:
    world = make_world()
    plan = survey(Random(5), 5000)
    assert uploaded(world, plan, target).result == 0
    assert downloaded(world, target) == payloads(plan)


# or not at all


@pytest.mark.slow
def test_at_20_percent_loss_a_plan_is_there_whole_or_not_at_all() -> None:
    ends: Counter[str] = Counter()
    for seed in range(SEEDS):
        random = Random(seed)
        world = QuietWorld(seed=seed)
        before, plan = survey(random, 50), survey(random, 50, number=1)
        assert uploaded(world, before, AUTOPILOT).result == 0
        heard, had = len(world.wire.acks), len(world.tasks())
        world.net.conditions = bad_net(random, loss=0.2)
        upload = uploaded(world, plan, AUTOPILOT)
        world.net.conditions = GOOD
        world.run(SETTLED)
        kept = downloaded(world)
        if kept == payloads(plan):
            assert len(world.tasks()) == had + 1, f"seed {seed}"
            assert world.wire.acks[heard:][-1][1].result == 0, f"seed {seed}"
            assert 49 in upload.requests, f"seed {seed}"
            ends[f"done; for the client {ENDS[upload.result or 0]}"] += 1
        else:
            assert kept == payloads(before), f"seed {seed}"
            assert upload.result in (TIMEOUT, 15), f"seed {seed}"
            assert len(world.tasks()) == had, f"seed {seed}"
            ends["done at neither end"] += 1
    print(dict(ends))
    assert ends["done; for the client done"] > SEEDS / 2


# never two in one


def test_a_download_goes_on_with_the_plan_with_which_it_began() -> None:
    world = QuietWorld(seed=1)
    other = world.add_client("other")
    random = Random(1)
    before, after = survey(random, 200), survey(random, 20, number=1)
    assert uploaded(world, before, AUTOPILOT).result == 0
    download = Download(other)
    world.until(lambda: len(download.items) >= 5, within=5)
    assert uploaded(world, after, AUTOPILOT).result == 0
    assert not download.is_done
    world.until(lambda: download.is_done, within=10)
    mav = common.MAVLink(None, 1, 1)
    assert [payload(message, mav) for message in download.items] == payloads(before)
    assert downloaded(world) == payloads(after)


def test_what_another_client_calls_off_goes_on() -> None:
    world = QuietWorld(seed=1)
    other = world.add_client("other")
    plan = survey(Random(1), 20)
    upload = Upload(world.client, plan)
    world.until(lambda: len(upload.requests) > 5, within=1)
    other.send(common.MAVLink_mission_ack_message(*AUTOPILOT, 15, 0))
    world.until(lambda: upload.result is not None, within=5)
    assert upload.result == 0
    assert downloaded(world) == payloads(plan)
