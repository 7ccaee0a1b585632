"""``mav-tasks serve`` as a process, on a store that outlives it."""

import asyncio
import ctypes
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

END_WITHIN = 15.0  # s; the server waits up to 3 s for the rover to stop
PR_SET_PDEATHSIG = 1  # prctl(2)


class ServerProcess:
    """Implements ``Server``."""

    def __init__(self, folder: Path, *options: str) -> None:
        """``options``: of ``mav-tasks serve``; store and log are in ``folder``."""
        self.log = folder / "server.log"
        self._options: Sequence[str] = (*options, "--store", str(folder / "tasks.sqlite3"))
        self._process: asyncio.subprocess.Process | None = None

    async def start(self) -> None:
        """Start it."""
        command = (sys.executable, "-m", "mav_tasks.cli", "serve", "--config", "", "--verbose")
        with self.log.open("ab") as output:
            self._process = await asyncio.create_subprocess_exec(
                *command,
                *self._options,
                stdout=output,
                stderr=asyncio.subprocess.STDOUT,
                start_new_session=True,  # only we handle Ctrl-C, and end the server last
                preexec_fn=_end_with_its_parent,
            )

    async def end(self) -> None:
        """Send SIGTERM, and SIGKILL after END_WITHIN."""
        if self._process is not None and self._process.returncode is None:
            self._process.send_signal(signal.SIGTERM)
            with suppress(TimeoutError):
                await asyncio.wait_for(self._process.wait(), END_WITHIN)
        await self.kill()

    async def kill(self) -> None:
        """Send SIGKILL."""
        process, self._process = self._process, None
        if process is not None:
            with suppress(ProcessLookupError):
                process.kill()
            await process.wait()

    def why_ended(self) -> str:
        """Return the last line of its log, "" if it runs."""
        if self._process is None or self._process.returncode is None:
            return ""
        return (self.log.read_text(errors="replace").splitlines() or ["it said nothing"])[-1]


def _end_with_its_parent() -> None:
    """Let the server stop its rovers and end if the trial is killed."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
