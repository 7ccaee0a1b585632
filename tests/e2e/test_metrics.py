"""Metrics of a real server: the figures against what happened, probes, hung and many scrapers."""

import json
import re
import socket
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.kit.processes import (
    Stand,
    command_long,
    free_tcp_ports,
    stand,
    submit,
    wait_for,
    wait_until,
)
from tests.kit.scraped import Figures, asked, check_with_promtool, figure, figures_of

MOVE, STOP = 54000, 54003
LIMIT = 30.0  # s


def scraped(port: int) -> Figures:
    status, text = asked(port, "/metrics")
    assert status == 200, text
    check_with_promtool(text)
    return figures_of(text)


def once(port: int, condition: Callable[[Figures], bool]) -> Figures:
    """Scrape until a condition is true; return those figures."""
    found: list[Figures] = []

    def is_so() -> bool:
        found.append(scraped(port))
        return condition(found[-1])

    wait_until(is_so, within=20, what=lambda: f"the figures:\n{found[-1]}")
    return found[-1]


@pytest.fixture
def port() -> int:
    (number,) = free_tcp_ports(1)
    return number


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "tasks.sqlite3"


@pytest.fixture
def running(tmp_path: Path, path: Path, port: int) -> Iterator[Stand]:
    with stand(tmp_path, "--metrics", f"127.0.0.1:{port}", serve_store=str(path)) as it:
        yield it


def test_the_figures_are_what_happened(running: Stand, port: int) -> None:
    link = running.connect()
    submit(link, MOVE, 0.5)
    wait_for(link, "STATUSTEXT", "'Task 1 done' in STATUSTEXT.text", within=20)
    running.drive(link, 50.0)
    submit(link, MOVE, 1.0)
    submit(link, STOP)
    wait_until(lambda: running.speed() < 0.01, within=10, what="the rover to stand")

    found = once(port, lambda now: figure(now, "mav_tasks_stop_standstill_seconds_count") == 1)

    def of_rover(name: str, **labels: str) -> float:
        return figure(found, f"mav_tasks_{name}", vehicle="1", **labels)

    assert of_rover("tasks_submitted_total") == 3
    assert of_rover("tasks_total", outcome="completed", reason="none") == 1
    assert of_rover("tasks_total", outcome="killed", reason="stop") == 1
    assert len(found["mav_tasks_tasks_total"]) == 2
    assert of_rover("tasks", state="queued", reason="queue_paused") == 1
    assert len(found["mav_tasks_tasks"]) == 1
    assert of_rover("queue_length") == 1
    assert of_rover("queue_capacity") == 1000
    assert of_rover("queue_paused", reason="stopped") == 1
    assert of_rover("halts_total", reason="stopped") == 1
    assert figure(found, "mav_tasks_task_wait_seconds_count") == 2
    driven = re.findall(r"task \d (?:completed|killed).*; (\d+) setpoints at", running.server.text)
    assert of_rover("setpoint_interval_seconds_count") == sum(map(int, driven)) > 20
    assert figure(found, "mav_tasks_stop_latency_seconds_count") == 1
    assert 0 < figure(found, "mav_tasks_stop_latency_seconds_sum") < LIMIT
    assert 0 < figure(found, "mav_tasks_stop_standstill_seconds_sum") < LIMIT
    assert figure(found, "mav_tasks_store_writable") == 1
    assert figure(found, "mav_tasks_store_commit_seconds_count") > 5
    to_rover = f"udpout:127.0.0.1:{running.rover_port}"
    assert figure(found, "mav_tasks_link_up", link=to_rover, side="vehicles") == 1
    for direction in ("sent", "received"):
        packets = figure(found, "mav_tasks_link_packets_total", link=to_rover, direction=direction)
        assert packets > 50
    assert figure(found, "process_resident_memory_bytes") > 1e7
    status, text = asked(port, "/grafana.json")
    assert (status, bool(json.loads(text)["panels"])) == (200, True)


def test_scrapers_that_hang_or_flood_keep_no_rover_from_its_end(running: Stand, port: int) -> None:
    link = running.connect()
    with ExitStack() as opened, ThreadPoolExecutor(50) as pool:
        for _ in range(20):
            hanging = opened.enter_context(
                socket.create_connection(("127.0.0.1", port), timeout=LIMIT)
            )
            hanging.sendall(b"GET /metrics HTTP/1.1\r\n")
        submit(link, MOVE, 2.0)
        at_once = [pool.submit(asked, port, "/metrics") for _ in range(50)]
        wait_for(link, "STATUSTEXT", "'Task 1 done' in STATUSTEXT.text", within=20)
        assert command_long(link, STOP).result == 0
        answers = []
        for each in at_once:
            try:
                answers.append(each.result()[0])
            except OSError:  # the kernel refuses what does not fit into the backlog
                answers.append(0)
        assert set(answers) <= {0, 200}
        assert asked(port, "/healthz") == (200, "ok\n")


HOST = b"Host: localhost\r\n"


def test_a_bad_request_is_answered_with_its_status(running: Stand, port: int) -> None:
    get = b"GET /metrics HTTP/1.1\r\n"
    for request, status in (
        (b"POST /metrics HTTP/1.1\r\n" + HOST + b"Content-Length: 3\r\n\r\nabc", 405),
        (b"GET /metrics\r\n\r\n", 400),
        (b"GET /metrics HTTP/2.0\r\n" + HOST + b"\r\n", 400),
        (b"\x16\x03\x01\x02\x00\x01\x00\r\n\r\n", 400),  # somebody tries TLS
        (get + b"\r\n", 400),
        (get + HOST + HOST + b"\r\n", 400),
        (get + b"X: " + b"x" * 20_000 + b"\r\n\r\n", 431),
        *((get + b"Host: " + host + b"\r\n\r\n", 403) for host in (b"10.0.0.1", b"[::2]", b"")),
        (get + b"Host: 127.0.0.1.evil.example\r\n\r\n", 403),
        (get + b"hOST:[::1]:8561 \r\n\r\n", 200),
        (b"GET /metrics?x=1 HTTP/1.0\r\n\r\n", 200),
        (b"GET / HTTP/1.1\r\n" + HOST + b"\r\n", 404),
    ):
        with socket.create_connection(("127.0.0.1", port), timeout=LIMIT) as connection:
            connection.sendall(request)
            answer = b"".join(iter(lambda: connection.recv(65_536), b""))
        assert answer.startswith(f"HTTP/1.1 {status} ".encode()), request
    found = once(port, lambda now: figure(now, "mav_tasks_metrics_requests_total", code="431") == 1)
    assert figure(found, "mav_tasks_metrics_requests_total", code="403") == 4


def test_it_is_ready_while_the_store_can_be_written(running: Stand, port: int, path: Path) -> None:
    link = running.connect()
    assert asked(port, "/readyz") == (200, "ok\n")
    away = path.with_name("away")
    path.rename(away)
    assert command_long(link, MOVE, 1.0, 0, 0, 11).result != 0
    wait_until(lambda: asked(port, "/readyz")[0] == 503, within=10, what="503")
    _, text = asked(port, "/readyz")
    assert text.startswith("new tasks are refused: store ")
    assert text.count("\n") == 1
    assert asked(port, "/healthz") == (200, "ok\n")
    assert figure(once(port, lambda _: True), "mav_tasks_store_writable") == 0
    away.rename(path)
    wait_until(
        lambda: command_long(link, MOVE, 0.2, 0, 0, 13).result == 0, within=10, what="a task"
    )
    assert asked(port, "/readyz") == (200, "ok\n")
