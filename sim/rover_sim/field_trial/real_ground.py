"""A real rover: ``mav-tasks serve`` runs as a process, on the store in the trial's folder."""

import asyncio
import shlex
import signal
import sys
from contextlib import suppress
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as mav

from mav_tasks.client.aio import Client
from mav_tasks.links.base import Link
from mav_tasks.links.link_limits import TO_VEHICLES
from mav_tasks.links.url import parse_url
from rover_sim.field_trial.endpoint import Endpoint
from rover_sim.field_trial.track import Track

END_WITHIN = 15.0  # s; the server waits up to 3 s for the rover to stop
UP_WITHIN = 10.0  # s
STICK_PERIOD = 0.1  # s between two RC_CHANNELS_OVERRIDE; each is valid for 3 s
LET_GO = (1500,) * 5 + (0,)  # µs: neutral before the release, or the last value lasts for 3 s
UNTOUCHED = 65535
THROTTLE = 2  # channel 3


class RealGround:
    """A real rover; implements ``Ground``."""

    def __init__(
        self,
        url: str,
        *,
        folder: Path,
        port: int,
        truth: Track | None,
        second: Endpoint | None,
        reboot_command: str,
        options: tuple[str, ...] = (),
    ) -> None:
        self.truth = truth
        self._url = url
        self._folder = folder
        self._port = port
        self._second = second
        self._reboot_command = reboot_command
        self._options = options
        self._server: asyncio.subprocess.Process | None = None
        self._stick: int | None = None
        self._pushing: asyncio.Task[None] | None = None

    @property
    def log(self) -> Path:
        """The server's log file."""
        return self._folder / "server.log"

    async def start_server(self) -> None:
        """Start ``mav-tasks serve``."""
        command = [sys.executable, "-m", "mav_tasks.cli", "serve", "--config", "", "--verbose"]
        command += ["--client", f"udpin:127.0.0.1:{self._port}", "--no-push"]
        command += ["--vehicle", self._url, "--store", str(self._folder / "tasks.sqlite3")]
        with self.log.open("ab") as output:
            self._server = await asyncio.create_subprocess_exec(
                *command,
                *self._options,
                stdout=output,
                stderr=asyncio.subprocess.STDOUT,
                start_new_session=True,  # only we handle Ctrl-C, and end the server last
            )

    async def end_server(self) -> None:
        """Send SIGTERM, and SIGKILL after END_WITHIN."""
        server, self._server = self._server, None
        if server is None or server.returncode is not None:
            return
        server.send_signal(signal.SIGTERM)
        try:
            await asyncio.wait_for(server.wait(), END_WITHIN)
        except TimeoutError:
            server.kill()
            await server.wait()

    async def kill_server(self) -> None:
        """Send SIGKILL."""
        server, self._server = self._server, None
        if server is not None:
            with suppress(ProcessLookupError):
                server.kill()
            await server.wait()

    def client(self) -> Client:
        """Return a client of the server."""
        return Client(f"udpout:127.0.0.1:{self._port}")

    def rover_link(self) -> Link | None:
        """Return a link to the rover's URL."""
        return parse_url(self._url).open(limits=TO_VEHICLES)

    @property
    def can_reboot(self) -> bool:
        """Whether there is a reboot command or a second link."""
        return bool(self._reboot_command) or self._second is not None

    async def reboot(self) -> None:
        """Run the reboot command, or send the MAVLink command over the second link."""
        if self._reboot_command:
            process = await asyncio.create_subprocess_exec(
                *shlex.split(self._reboot_command),
                stdout=asyncio.subprocess.DEVNULL,
                start_new_session=True,
            )
            await process.wait()
        elif self._second is not None:
            # param1 1: the autopilot; param6 20190226: even while armed
            values = (1.0, 0.0, 0.0, 0.0, 0.0, 20190226.0)
            self._second.command(mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, *values)

    @property
    def can_push_stick(self) -> bool:
        """Whether there is a second link."""
        return self._second is not None

    def push_stick(self, throttle: int | None) -> None:
        """Send RC_CHANNELS_OVERRIDE of the throttle until it is released."""
        self._stick = throttle
        if self._pushing is None:
            self._pushing = asyncio.ensure_future(self._push())

    async def close(self) -> None:
        """Release the stick and end the server."""
        if self._pushing is not None:
            self._pushing.cancel()
            with suppress(asyncio.CancelledError):
                await self._pushing
        await self.end_server()

    async def _push(self) -> None:
        while self._stick is not None:
            await self._override(self._stick)
        for throttle in LET_GO:
            await self._override(throttle)
        self._pushing = None

    async def _override(self, throttle: int) -> None:
        assert self._second is not None
        channels = [UNTOUCHED] * 8
        channels[THROTTLE] = throttle
        self._second.out.rc_channels_override_send(self._second.system, 1, *channels)
        await asyncio.sleep(STICK_PERIOD)
