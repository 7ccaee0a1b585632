"""The demonstration in real time: server, rover and page are separate processes."""

import asyncio
import os
import sys
import tempfile
import time
import webbrowser
from contextlib import ExitStack, suppress
from pathlib import Path

import typer

from mav_tasks.links.link_limits import TO_CLIENTS
from mav_tasks.links.url import parse_url
from rover_sim.demo.third_party import ThirdParty
from rover_sim.observing.observer import Observer
from rover_sim.observing.track import Track
from rover_sim.observing.truth import from_file
from rover_sim.testing.processes import LOOK, Process, free_ports, module


def drive(*, body: str, gui: bool, seed: int, record: str, web: bool) -> tuple[ThirdParty, Track]:
    """Run server, rover and third party; return the third party and the true track.

    ``web``: serve the web page, too, and go on with it until Ctrl-C.
    """
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="mav-tasks-demo-")))
        truth, store = folder / "truth.csv", str(folder / "demo.sqlite3") if web else ":memory:"
        running: list[Process] = []

        def start(name: str, text: str, *more: str) -> Process:
            running.append(stack.enter_context(module(name, text, *more, folder=folder)))
            return running[-1]

        def check() -> None:
            for each in running:
                each.check()

        async def watch() -> tuple[ThirdParty, Track]:
            observer = Observer(parse_url(server).open(limits=TO_CLIENTS))
            with from_file(truth) as track:
                party = ThirdParty(observer, lambda: track.last, typer.echo, check)
                await party.run()
                observer.close()
                return party, track

        rover_port, client_port = free_ports(2)
        text = f"--port {rover_port} --body {body}" + (" --gui" if gui else "")
        text += f" --seed {seed} --friction-variation 0.3" if seed else ""
        rover = start("rover_sim", text, "--truth", str(truth))
        text = f"serve --config= --client udpin:127.0.0.1:{client_port}"
        text += f" --vehicle udpout:127.0.0.1:{rover_port} --store"
        start("mav_tasks.cli", text, store, *(("--record", record) if record else ()))
        typer.echo(f"rover: {body} body on UDP {rover_port}; server on UDP {client_port}")
        typer.echo("a QGroundControl on this machine will see the rover")
        server = f"udpout:127.0.0.1:{client_port}"
        if web:
            keys = folder / "keys.toml"  # none: nobody needs a token, whatever keys the user has
            keys.touch(mode=0o600)
            text = f"web --server {server} --listen 127.0.0.1:0 --store"
            page = start("mav_tasks.cli", text, store, "--keys", str(keys))
            url = page.said(r"web page: (\S+)")[1]
            typer.echo(f"web page: {url}")
            # in the user's browser, if there is a screen
            if sys.platform == "darwin" or {"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys():
                webbrowser.open(url)
        rover.said(" on udp")
        found = asyncio.run(watch())
        if web:
            typer.echo("the rover, the server and the page go on: press Ctrl-C to end them")
            with suppress(KeyboardInterrupt):
                while True:
                    check()
                    time.sleep(LOOK)
        return found
