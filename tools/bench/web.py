"""The web page in a real Chromium: how large and quick it is, and what browsers cost the server.

All clocks are of this machine. STOP is measured from the press of the button in the page to the
HOLD at the rover's socket, which leaves with the zero setpoint; a change of a rover from its packet
at the web process to the frame in which the page has painted it.
"""

import gzip
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from time import monotonic, sleep, time
from typing import Any
from urllib.request import urlopen

from mav_tasks.mavlink.enums import MavCmd
from tests.kit import chromium

from .driving import PERIOD, driven
from .harness import HOST, Rovers, Row, Rows, beside, p50, p99, server, simulated_rovers
from .load import events, faced, held

BROWSERS, ROVERS = 50, 100
STOPS, LOADS, ROUNDS = 20, 10, 3
BETWEEN = 1.2  # s between STOPs, after which the server asks for HOLD at once again
WATCHED = 10.0  # s
PRESS = """() => {
  const options = {bubbles: true, button: 0, pointerId: 1}, at = Date.now();
  document.getElementById('stop-all').dispatchEvent(new PointerEvent('pointerdown', options));
  return at / 1000;
}"""
PAINT = "performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? 0"
FILES = "performance.getEntriesByType('resource').map((each) => each.name)"
WATCH = """
window.pixels = [];
const add = EventSource.prototype.addEventListener;
EventSource.prototype.addEventListener = function (kind, listener, ...rest) {
  if (kind !== 'vehicles') return add.call(this, kind, listener, ...rest);
  return add.call(this, kind, (event) => {
    listener(event);
    const {since} = JSON.parse(event.data);
    requestAnimationFrame(() => setTimeout(() => {
      window.pixels.push(Date.now() / 1000 - since);
    }));
  }, ...rest);
};
"""


def web() -> Rows:
    """Size, first paint, STOP in the page, packet → pixel, setpoints; with 50 browsers."""
    with chromium.running() as browser:
        with Rovers() as rover, server(rover.port) as it, faced("web", it.port) as page:
            rover.wait()
            yield from _loads(browser, page.port, rover)
            alone, crowd = (_pressed(browser, page.port, rover, each) for each in (1, BROWSERS))
            what = f"STOP in the page → HOLD at the rover, {BROWSERS} browsers"
            yield Row(f"{what}, p50", p50(crowd), "ms", p50(alone), "with one")
            yield Row(f"{what}, longest", max(crowd), "ms", max(alone), "with one", "≤ 50 ms")
        yield _painted(browser)
    yield _driven()


def _loads(browser: Any, port: int, rover: Rovers) -> Rows:
    paints, url = [], f"http://{HOST}:{port}/"
    for _ in range(LOADS):
        page = browser.new_context().new_page()
        page.goto(url)
        while not (paint := page.evaluate(PAINT)):
            page.wait_for_timeout(20)
        page.wait_for_selector(".rover-mark, .card", state="attached")
        paints.append(paint / 1000)
        files = {each for each in page.evaluate(FILES) if not each.endswith("/events")} | {url}
        page.context.close()
        _serve(rover)
    size = sum(len(gzip.compress(urlopen(each).read())) for each in files)
    yield Row("web page, gzipped", size, "kB", goal="≤ 250 kB")
    yield Row("first paint, median", p50(paints), "ms", goal="≤ 500 ms")


def _pressed(browser: Any, port: int, rover: Rovers, browsers: int) -> list[float]:
    """Return the seconds from pressing STOP in the page to HOLD at the rover."""
    times = []
    with beside(held, port, browsers - 1, events(port), True):
        page = browser.new_page()
        page.goto(f"http://{HOST}:{port}/")
        page.wait_for_selector(".card")
        for _ in range(STOPS):
            pressed = page.evaluate(PRESS)
            times.append(_serve(rover, until_hold=True) - pressed)
            end = monotonic() + BETWEEN
            while monotonic() < end:
                _serve(rover)
        page.close()
    return times


def _serve(rover: Rovers, *, until_hold: bool = False) -> float:
    """Play the rover for a moment, or until HOLD is asked for; return the time.

    A STOP sends HOLD with a zero. Zeros alone come 20 times a second until the rover is seen to
    stand, which this one never is.
    """
    rover.settimeout(0.05)
    while True:
        rover.beat()
        data = b""
        with suppress(TimeoutError):
            data = rover.recv(2048)
        now = time()
        asked = {getattr(each, "command", None) for each in rover.answer(data)}
        if not until_hold or MavCmd.DO_SET_MODE in asked:
            return now


def _painted(browser: Any) -> Row:
    with (
        simulated_rovers(ROVERS) as rovers,
        server(rovers) as it,
        faced("web", it.port) as shown,
    ):
        page = browser.new_page()
        page.add_init_script(WATCH)
        page.goto(f"http://{HOST}:{shown.port}/")
        page.wait_for_function(f"() => document.querySelectorAll('.card').length >= {ROVERS}")
        page.evaluate("window.pixels.length = 0")
        page.wait_for_timeout(WATCHED * 1000)
        pixels = page.evaluate("window.pixels")
        page.close()
    note = f"p50 {p50(pixels) * 1e3:.0f} ms, {len(pixels) / WATCHED:.0f} frames/s"
    what = f"packet → pixel, p99, {ROVERS} rovers"
    return Row(what, p99(pixels), "ms", goal="≤ 150 ms", note=note)


def _driven() -> Row:
    """Setpoints of a rover with and without browsers, in turns."""

    @contextmanager
    def watched(browsers: int, server: int) -> Iterator[None]:
        with faced("web", server) as it, beside(held, it.port, browsers, events(it.port), True):
            sleep(1.0)
            yield

    found: dict[int, list[float]] = {0: [], BROWSERS: []}
    for browsers in [*found] * ROUNDS:
        it = driven(1, meanwhile=partial(watched, browsers))
        found[browsers].append(PERIOD + it.error)
    without, crowd = (p50(each) for each in found.values())
    what = f"interval of setpoints, p99, {BROWSERS} browsers"
    return Row(what, crowd, "ms", without, "without", "≤ 1.05×")
