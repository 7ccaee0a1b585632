"""The web page in a real Chromium: how large and quick it is, and what browsers cost the server.

All clocks are of this machine. STOP is measured from the press of the button in the page to the
HOLD at the rover's socket, which leaves with the zero setpoint; a change of a rover from its packet
at the web process to the frame in which the page has painted it.
"""

import gzip
import json
import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from statistics import median, quantiles
from threading import Event, Thread
from typing import Any

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.codec import Decoder
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.mavlink.packet import split_datagram

from .child import HOST, child, free_port, simulated_rovers, udp_socket
from .scripted import ScriptedVehicle, loopback
from .table import Row

BROWSERS = 50
ROVERS = 100
STOPS = 40
BETWEEN = 1.2  # s, after which the server asks for HOLD at once again
LOADS = 10
WATCHED = 10.0  # s
DRIVEN = 15.0  # s
ROUNDS = 3
GOAL_BYTES, GOAL_PAINT, GOAL_PIXEL, GOAL_STOP, GOAL_JITTER = 250_000, 0.5, 0.15, 0.05, 1.05

PRESS = """() => {
  const at = Date.now();
  const options = {bubbles: true, button: 0, pointerId: 1};
  document.getElementById('stop-all').dispatchEvent(new PointerEvent('pointerdown', options));
  return at / 1000;
}"""
WATCH = """
window.pixels = [];
const add = EventSource.prototype.addEventListener;
EventSource.prototype.addEventListener = function (kind, listener, ...rest) {
  if (kind !== 'vehicles') return add.call(this, kind, listener, ...rest);
  return add.call(this, kind, (event) => {
    listener(event);
    const {since} = JSON.parse(event.data);
    requestAnimationFrame(() => setTimeout(() => {
      window.pixels.push(Date.now() - since * 1000);
    }));
  }, ...rest);
};
"""


def measure() -> list[Row]:
    """Return the rows; a note instead if there is no browser."""
    path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None)
    if path is None:
        raise SystemExit("web: no Chromium: tools/setup --browser installs it")
    from playwright.sync_api import sync_playwright  # noqa: PLC0415  # only here

    options = ["--no-sandbox"] if os.geteuid() == 0 else []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=options)
        rows = [*_of_stop(browser), *_of_many_rovers(browser), *_of_jitter()]
        browser.close()
    return rows


def _of_stop(browser: Any) -> Iterator[Row]:
    """Size and first paint, and STOP with one browser and with many."""
    port = free_port()
    with udp_socket() as vehicle_socket:
        vehicle = ScriptedVehicle(vehicle_socket)
        with child("server", str(port), str(vehicle_socket.getsockname()[1]), quiet=True):
            while vehicle.server is None:
                vehicle.answer(wait=1.0)
            seen: list[float] = []
            is_over = Event()
            playing = Thread(target=_play, args=(vehicle_socket, vehicle, seen, is_over))
            playing.start()
            try:
                with _web(port) as url:
                    yield from _of_loads(browser, url)
                    yield from _of_presses(browser, url, seen)
            finally:
                is_over.set()
                playing.join()


def _of_loads(browser: Any, url: str) -> Iterator[Row]:
    paints = []
    for _ in range(LOADS):
        page = browser.new_context().new_page()
        page.goto(url)
        page.wait_for_selector(".rover-mark, .card", state="attached")
        paint = "performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? 0"
        page.wait_for_function(f"() => ({paint}) > 0")
        paints.append(page.evaluate(paint) / 1000)
        urls = page.evaluate("performance.getEntriesByType('resource').map((each) => each.name)")
        page.context.close()
    files = {each for each in urls if not each.endswith("/events")} | {url}
    size = sum(len(gzip.compress(urllib.request.urlopen(each).read())) for each in files)
    met = size <= GOAL_BYTES
    yield Row("web page, gzipped", f"{size / 1000:.0f} kB", "", "", "≤ 250 kB", met)
    seconds = median(paints)
    shown = f"{seconds * 1e3:.0f} ms"
    yield Row("first paint, median", shown, "", "", "≤ 500 ms", seconds <= GOAL_PAINT)


def _of_presses(browser: Any, url: str, seen: list[float]) -> Iterator[Row]:
    figures = {}
    for browsers in (1, BROWSERS):
        port = url.rpartition(":")[2].rstrip("/")
        others = child("streams", port, str(browsers - 1)) if browsers > 1 else nullcontext()
        with others:
            page = browser.new_page()
            page.goto(url)
            page.wait_for_selector(".card")
            times = []
            for _ in range(STOPS):
                seen.clear()
                pressed = page.evaluate(PRESS)
                while not seen:
                    time.sleep(0.0005)
                times.append(seen[0] - pressed)
                time.sleep(BETWEEN)
            page.close()
        cuts = quantiles(times, n=100)
        figures[browsers] = cuts[49], cuts[98]
    (p50, p99), alone = figures[BROWSERS], figures[1]
    yield Row(
        f"STOP in the page → HOLD at the rover, p99, {BROWSERS} browsers",
        f"{p99 * 1e3:.1f} ms",
        f"{alone[1] * 1e3:.1f} ms with one",
        f"{p99 / alone[1]:.1f}×",
        f"< {GOAL_STOP * 1e3:.0f} ms",
        p99 < GOAL_STOP,
    )
    shown, one = f"{p50 * 1e3:.1f} ms", f"{alone[0] * 1e3:.1f} ms with one"
    yield Row("the same, p50", shown, one, f"{p50 / alone[0]:.1f}×", "", None)


def _play(sock: socket.socket, vehicle: ScriptedVehicle, seen: list[float], is_over: Event) -> None:
    """Play the rover, and note when HOLD comes: a STOP sends it with a zero, in one step.

    Zeros alone come 20 times a second until the rover is seen to stand, which this one never is.
    """
    beat_at, decoder = 0.0, Decoder()
    sock.settimeout(0.05)
    while not is_over.is_set():
        if time.monotonic() >= beat_at:
            beat_at = time.monotonic() + 0.5
            vehicle.beat()
        try:
            data = sock.recv(2048)
        except TimeoutError:
            continue
        now = time.time()
        for packet in split_datagram(data):
            message = decoder.decode(packet)
            if isinstance(message, m.CommandLong):
                if message.command == MavCmd.DO_SET_MODE:
                    seen.append(now)
                vehicle.acknowledge(message)


def _of_many_rovers(browser: Any) -> Iterator[Row]:
    port, vehicle_port = free_port(), free_port()
    with (
        simulated_rovers(ROVERS, vehicle_port),
        child("server", str(port), str(vehicle_port), quiet=True),
        _web(port) as url,
    ):
        page = browser.new_page()
        page.add_init_script(WATCH)
        page.goto(url)
        page.wait_for_function(f"() => document.querySelectorAll('.card').length >= {ROVERS}")
        page.evaluate("window.pixels.length = 0")
        page.wait_for_timeout(WATCHED * 1000)
        pixels = [each / 1000 for each in page.evaluate("window.pixels")]
        page.close()
    cuts = quantiles(pixels, n=100)
    yield Row(
        f"packet → pixel, p99, {ROVERS} rovers",
        f"{cuts[98] * 1e3:.0f} ms",
        f"p50 {cuts[49] * 1e3:.0f} ms, {len(pixels) / WATCHED:.0f} frames/s",
        "",
        "≤ 150 ms",
        cuts[98] <= GOAL_PIXEL,
    )


def _of_jitter() -> Iterator[Row]:
    """p99 of the intervals between setpoints, with and without browsers, in turns."""
    port, vehicle_port = free_port(), free_port()
    found: dict[int, list[float]] = {0: [], BROWSERS: []}
    with (
        simulated_rovers(1, vehicle_port),
        child("server", str(port), str(vehicle_port), "--drive", quiet=True),
        _web(port) as url,
    ):
        web_port = url.rpartition(":")[2].rstrip("/")
        for _ in range(ROUNDS):
            for browsers, p99s in found.items():
                others = child("streams", web_port, str(browsers)) if browsers else nullcontext()
                with others:
                    p99s.append(_driven(url))
    without, with_them = (median(each) for each in found.values())
    yield Row(
        f"interval of setpoints, p99, {BROWSERS} browsers",
        f"{with_them * 1e3:.2f} ms",
        f"{without * 1e3:.2f} ms without",
        f"{with_them / without:.2f}×",
        f"≤ {GOAL_JITTER:.2f}×",
        with_them / without <= GOAL_JITTER,
    )


def _driven(url: str) -> float:
    goals = [{"kind": "drive", "forward": 0.2, "yaw_rate": 20, "duration": DRIVEN}]
    while True:
        try:
            task = _asked(f"{url}api/v1/vehicles/1/tasks", {"goals": goals})
            break
        except OSError:
            time.sleep(0.2)  # the rover is not known yet
    at = f"{url}api/v1/tasks/{task['id']}"
    while (state := _asked(at)["state"]) != "completed":
        if state in ("held", "failed"):
            raise RuntimeError(f"the task is {state}")
        time.sleep(0.2)
    return float(_asked(f"{at}/timing")["p99"])


def _asked(url: str, body: Any = None) -> Any:
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(url, data, {"content-type": "application/json"})
    with urllib.request.urlopen(request, timeout=15) as answer:
        return json.load(answer)


@contextmanager
def _web(port: int) -> Iterator[str]:
    """Run a web process for a ``with`` block; yield its address."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "web.log"
        command = [sys.executable, "-m", "mav_tasks.cli", "web", "--store", ""]
        command += ["--server", f"udpout:{HOST}:{loopback(port)[1]}", "--listen", f"{HOST}:0"]
        keys = Path(folder) / "keys.toml"  # none: nobody needs a token
        keys.touch(mode=0o600)
        command += ["--keys", str(keys)]
        with log.open("wb") as output:
            running = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)
        try:
            while not (found := re.search(r"web page: (\S+)", log.read_text())):
                if running.poll() is not None:
                    raise RuntimeError(log.read_text())
                time.sleep(0.05)
            yield found[1]
        finally:
            running.terminate()
            running.wait(10)
