"""Every kind of link, on both sides, with a real server and stock pymavlink as the client."""

from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from itertools import pairwise
from pathlib import Path
from time import monotonic
from typing import Any

import pytest

from rover_sim.geo import DEFAULT_ORIGIN
from tests.kit.bridges import Bridge, SerialFar, TcpFar, bridge
from tests.kit.lines import slow_line
from tests.kit.processes import (
    Stand,
    free_tcp_ports,
    stand,
    submit,
    wait_for,
    wait_until,
)

HOST = "127.0.0.1"
BAUD = 57_600
ANSWER = 0.5  # s, within which each command is acknowledged
#: ATTITUDE, LOCAL_POSITION_NED, GLOBAL_POSITION_INT, VFR_HUD, GPS_RAW_INT, SYS_STATUS
STREAMS = (30, 32, 33, 74, 24, 1)
MAGIC_V2 = 0xFD
PLACES = [DEFAULT_ORIGIN.to_global(2.0 * n, -n) for n in range(5)]


# the clients' side


@contextmanager
def over_tcp(folder: Path) -> Iterator[tuple[tuple[str, ...], Callable[[Stand], Any]]]:
    (port,) = free_tcp_ports(1)
    url = f"tcp:{HOST}:{port}"
    yield ("--client", f"tcpin:{HOST}:{port}"), lambda running: running.heard(url)


@contextmanager
def over_tcp_dialled(folder: Path) -> Iterator[tuple[tuple[str, ...], Callable[[Stand], Any]]]:
    """The server dials a client that begins to listen when it has been running for a while."""
    (port,) = free_tcp_ports(1)
    url = f"tcpin:{HOST}:{port}"

    def connect(running: Stand) -> Any:
        running.server.wait_for(f"link tcp:{HOST}:{port} is not available yet: Connection refused")
        return running.heard_by(url)

    yield ("--client", f"tcp:{HOST}:{port}"), connect


@contextmanager
def over_a_slow_line(folder: Path) -> Iterator[tuple[tuple[str, ...], Callable[[Stand], Any]]]:
    with slow_line(folder, baud=BAUD) as (ours, theirs):
        yield (
            ("--client", f"serial:{ours}:{BAUD}"),
            lambda running: running.heard(str(theirs), baud=BAUD),
        )


@pytest.mark.slow
@pytest.mark.parametrize("way", [over_tcp, over_tcp_dialled, over_a_slow_line])
def test_the_same_script_works_over_every_kind_of_link(
    tmp_path: Path,
    way: Callable[[Path], AbstractContextManager[tuple[tuple[str, ...], Callable[[Stand], Any]]]],
) -> None:
    with way(tmp_path) as (options, connect), stand(tmp_path, *options) as running:
        link = connect(running)
        numbers = numbers_from(link)

        for message_id in STREAMS:  # together twice what the slow line takes
            submit(link, 511, message_id, 20_000.0, target=(1, 1))
        task_id = submit(link, 54000, 2.0, 0, 0, 0, 0, 0, 8)
        answers = []
        for number in range(5):
            sent_at = monotonic()
            assert submit(link, 54001, 10.0 + number) == task_id + 1 + number
            answers.append(monotonic() - sent_at)
        assert max(answers) < ANSWER
        upload(link, PLACES)
        assert download(link) == PLACES
        wait_for(link, "STATUSTEXT", f"'Task {task_id} done' in STATUSTEXT.text", within=30)

        assert len(numbers[1, 1]) > 100
        for source in ((1, 1), (1, 191)):
            assert [(b - a) % 256 for a, b in pairwise(numbers[source])].count(1) == (
                len(numbers[source]) - 1
            ), source
        assert link.mav.total_receive_errors == 0


def numbers_from(link: Any) -> dict[tuple[int, int], list[int]]:
    """Return the sequence numbers of all that comes from now on, by source.

    pymavlink counts losses itself, but takes messages of our dialect for somebody else's.
    """
    numbers = defaultdict[tuple[int, int], list[int]](list)
    post = link.post_message

    def note(message: Any) -> None:
        raw = message.get_msgbuf()
        if message.get_type() != "BAD_DATA" and raw[0] == MAGIC_V2:
            numbers[raw[5], raw[6]].append(raw[4])
        post(message)

    link.post_message = note
    return numbers


def upload(link: Any, places: list[tuple[int, int]]) -> None:
    """Stage a plan at the rover, item by item as it is asked for."""
    link.mav.mission_count_send(1, 1, len(places), 0)
    while True:
        asked = wait_for(link, ["MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_ACK"])
        if asked.get_type() == "MISSION_ACK":
            assert asked.type == 0, asked
            return
        link.mav.mission_item_int_send(
            1, 1, asked.seq, 6, 16, 0, 1, 0, 0, 0, float("nan"), *places[asked.seq], 0, 0
        )


def download(link: Any) -> list[tuple[int, int]]:
    """Return the places of the plan that the rover has."""
    link.mav.mission_request_list_send(1, 1, 0)
    count = wait_for(link, "MISSION_COUNT").count
    places = []
    for seq in range(count):
        link.mav.mission_request_int_send(1, 1, seq, 0)
        item = wait_for(link, "MISSION_ITEM_INT", f"MISSION_ITEM_INT.seq=={seq}")
        places.append((item.x, item.y))
    link.mav.mission_ack_send(1, 1, 0, 0)
    return places


# the vehicles' side


def over(make: Callable[[], Any], made: list[Bridge]) -> Callable[[int], Any]:
    @contextmanager
    def way(rover_port: int) -> Iterator[str]:
        with bridge(rover_port, make()) as it:
            made.append(it)
            yield it.url

    return way


FARS: dict[str, Callable[[Path], Any]] = {
    "TCP": lambda folder: TcpFar(),
    "serial line": lambda folder: SerialFar(folder / "ttyRover", baud=115_200),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", FARS)
def test_a_rover_is_driven_stops_when_its_link_is_cut_and_goes_on_when_it_is_back(
    tmp_path: Path, kind: str
) -> None:
    bridges: list[Bridge] = []
    way = over(partial(FARS[kind], tmp_path), bridges)
    with stand(tmp_path, "--arming", "server", way=way) as running:
        (between,) = bridges
        link = running.connect()
        start = running.truth()[-1]
        task_id = running.drive(link, 3.0)

        between.cut()

        cut_at = running.truth()[-1]["time"]
        running.server.wait_for(f"link {between.url} lost: ")
        wait_for(link, "STATUSTEXT", f"'Task {task_id} paused' in STATUSTEXT.text")
        wait_until(lambda: running.speed() < 0.01, within=10, what="the rover to stand")
        assert running.truth()[-1]["time"] - cut_at > 2.0  # by its own time-out

        between.mend()

        running.server.wait_for(f"link {between.url} is back")
        wait_for(link, "STATUSTEXT", f"'Task {task_id} done' in STATUSTEXT.text", within=30)
        end = running.truth()[-1]
        assert end["north"] - start["north"] == pytest.approx(3.0, abs=0.1)
        assert ": server was late" not in running.server.text  # as a task that is held for it says
