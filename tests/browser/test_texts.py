"""Texts on the page: hundreds of them, from two rovers, filtered, and older ones."""

import socket
from collections.abc import Iterator
from pathlib import Path
from threading import Event, Thread
from typing import Any

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from tests.browser.kit import judge, opened, says
from tests.kit.processes import Stand, free_udp_ports, process, wait_until
from tests.kit.web import Web, web

pytestmark = pytest.mark.slow

ROVERS = (7, 8)
TEXTS = 699  # more than the page shows at first, and loads at a time
ERROR, WARNING, INFO, DEBUG = 3, 4, 6, 7
RARE = 3  # the first ones, of rover 7, are errors: far older than what the page has at first
EACH = 0.008  # s between two texts
OLDER = "#panel-texts button:text-is('Older')"
LINES = "(() => [...document.querySelectorAll('#panel-texts .log li')].map((e) => e.textContent))"


def severity_of(number: int) -> int:
    """Return the severity of a text by its number."""
    if number < RARE:
        return ERROR
    return (INFO, WARNING, INFO, DEBUG)[number % 4]


@pytest.fixture(scope="module")
def talkative(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Web]:
    """A web process that has all texts of two rovers that only talk."""
    folder = tmp_path_factory.mktemp("talkative")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as rovers:
        rovers.bind(("127.0.0.1", 0))
        port = rovers.getsockname()[1]
        (client_port,) = free_udp_ports(1)
        may_talk, is_over = Event(), Event()
        talking = Thread(target=_talk, args=(rovers, may_talk, is_over))
        serve = ("-m", "mav_tasks.cli", "serve", "--no-push", "--store", ":memory:")
        ends = (f"--client=udpin:127.0.0.1:{client_port}", f"--vehicle=udpout:127.0.0.1:{port}")
        with process(*serve, *ends, folder=folder, name="server") as server:
            it = Stand(server, server, client_port, port, 0, folder)
            talking.start()
            try:
                with web(folder, it) as page:
                    wait_until(
                        lambda: len(page.get("/vehicles")["vehicles"]) == len(ROVERS),
                        within=20,
                        what="both rovers",
                    )
                    may_talk.set()
                    last = f"text {TEXTS - 1}"
                    wait_until(
                        lambda: any(each["words"] == last for each in page.get("/texts")["texts"]),
                        within=60,
                        what=f"{last} in the web process",
                    )
                    yield page
            finally:
                is_over.set()
                talking.join()


def _talk(sock: socket.socket, may_talk: Event, is_over: Event) -> None:
    """Send heartbeats of the rovers, and all texts once they are wanted, rover by rover."""
    encoders = {rover: Encoder(Address(rover, 1)) for rover in ROVERS}
    sock.settimeout(0.5)
    where, number, beats = None, 0, 0
    while not is_over.wait(EACH):
        if where is None or beats % 10 == 0:
            try:
                _, where = sock.recvfrom(2048)
            except TimeoutError:
                continue
        for encoder in encoders.values() if beats % 20 == 0 else ():
            sock.sendto(encoder.encode(m.Heartbeat(10, 3, 0, 4, 3, 3)), where)
        beats += 1
        if may_talk.is_set() and number < TEXTS:
            words = f"text {number}".encode()
            severity = severity_of(number)
            text = m.Statustext(severity, words, 0, 0)
            sock.sendto(encoders[ROVERS[number % 2] if number >= RARE else 7].encode(text), where)
            number += 1


def shown(page: Any) -> list[int]:
    """Return the numbers of the rovers' texts that are shown, from above."""
    lines = page.evaluate(LINES)
    return [int(line.rpartition("text ")[2]) for line in lines if ": text " in line]


def test_older_texts_are_loaded_and_filtered(chromium: Any, talkative: Web, shots: Path) -> None:
    with opened(chromium, talkative, waits=False) as page:
        page.wait_for_selector(".card >> nth=1")
        page.click("#tab-texts")
        says(page, "#panel-texts li", f"text {TEXTS - 1}")
        first = shown(page)
        assert DEBUG not in {severity_of(each) for each in first}
        assert min(first) > TEXTS // 2

        # by keyboard, which stays on the button until all is there
        page.focus(OLDER)
        page.keyboard.press("Enter")
        says(page, "#panel-texts [role=status]", "older lines shown.")
        assert page.evaluate("document.activeElement.textContent") == "Older"
        assert min(shown(page)) < min(first)
        while page.is_visible(OLDER):
            page.keyboard.press("Enter")
            page.wait_for_selector("#panel-texts .log:not([aria-busy=true])")
        says(page, "#panel-texts li", "rover 7: text 0")
        assert page.evaluate("document.activeElement.id") == "panel-texts"
        assert shown(page) == [n for n in reversed(range(TEXTS)) if severity_of(n) != DEBUG]
        judge(page, "texts")
        page.screenshot(path=str(shots / "texts.png"))

        page.select_option("#panel-texts label:has-text('Level') select", "4")
        wanted = [n for n in reversed(range(TEXTS)) if severity_of(n) <= WARNING]
        assert shown(page) == wanted
        page.select_option("#panel-texts label:has-text('Rover') select", "chosen")
        assert shown(page) == [n for n in wanted if n < RARE or n % 2 == 0]
        page.click(".card >> nth=1 >> .pick")
        says(page, ".card.chosen", "Rover 8")
        page.wait_for_function(f"() => {LINES}().every((line) => line.includes('rover 8: '))")
        assert shown(page) == [n for n in wanted if n >= RARE and n % 2]
