"""The real MAVProxy, unmodified, at its own command line in a pseudo-terminal.

What is good to know of release 1.8.75, found by trying and in its source:

- It locks onto the address of the first autopilot's heartbeat, (N, 1), and passes over texts of all
  other components. Told ``--target-system N`` it leaves the component at 0: commands go to (N, 0),
  and the texts of the task server are shown, as "AP: Task 1 done".
- A COMMAND_ACK is shown by name, "Got COMMAND_ACK: DO_SET_MODE: ACCEPTED"; one for a command number
  that it has no name for as the whole message, which brings ``result_param2``.
- ``long NUMBER …`` fills what is not given with 0, so a task has priority 0; "nan" can be said.
- It asks for parameters by file transfer first, and by PARAM_REQUEST_LIST once that is refused, by
  itself if it has none yet, else when told again; unanswered it tries for 11 s.
- It does not say that a ``param set`` worked, only if it did not.
- Coordinates of ``wp``, ``fence`` and ``guided`` are cut to 1e-7 degrees, not rounded: 149.1657
  goes out as 149.1656999.
- ``mode NAME`` works for ArduPilot only: of a PX4's modes it has a table of triples, and takes one
  for a number ("required argument is not a float"). ``long DO_SET_MODE 1 4 3`` works.
- A mode is announced every 2 s at the most; the prompt shows each one, but is written only along
  with the next line. An empty line brings it forth.
- A message that its dialects lack comes from component 0 of system 0 as pymavlink sees it, so each
  leaves a hole in the numbers of who sent it, and is counted as lost.
- A rover that does not call its fence healthy makes it say "fence breach", though there is none.
- A rover that restarts after half a minute or more makes it say "Time has wrapped".
- ``exit`` needs an end of file in place of the next line, and its exit code is 1 however it ends.
"""

import os
import pty
import re
import subprocess
import sys
import sysconfig
import termios
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from tests.kit.processes import STOP_LIMIT, wait_until

STAMP_LENGTH = 8  # of a packet in a tlog; those that it sends are there, too
HEADER_LENGTH, CRC_LENGTH = 10, 2
MAVLINK_2 = 0xFD
ITS_SYSTEM = 255
END_OF_FILE = b"\x04"
#: What it says when something is not as it should be, be it its own finding or a rover's answer.
COMPLAINT = re.compile(
    r"error|fail|time?d? ?out|no ack|no link|link \d+ down|\blost\b|re-requesting|unexpected|denied"
    r"|unsupported|reject|not in control|cancelled|traceback|exception|wrapped|breach|stale"
    r"|unknown|unable|invalid|duplicate|\bbad\b|not (?:available|found)|can't",
    re.IGNORECASE,
)
PATIENCE = 10.0  # s, for an answer
PROMPT_WITHIN = 0.1  # s, after a line
#: Often there is something behind it on its line.
PROMPT = re.compile(r"^[\w()]+> ", re.MULTILINE)
LINK = re.compile(
    r"link 1 (?P<state>\w+) \((?P<packets>\d+) packets, .* (?P<lost>\d+) lost, (?P<loss>[\d.]+)%"
)


class Logged(NamedTuple):
    """The header of a packet."""

    system_id: int
    component_id: int
    seq: int
    message_id: int


class MavProxy:
    """A session: type a line, wait for what it says."""

    def __init__(self, popen: subprocess.Popen[bytes], terminal: int, folder: Path) -> None:
        self.popen = popen
        self._terminal = terminal
        self._folder = folder
        self._heard = bytearray()
        self._mark = 0
        # All the while, lest it stands still with its terminal full and loses packets.
        self._reader = threading.Thread(target=self._read, name="mavproxy", daemon=True)
        self._reader.start()

    @property
    def text(self) -> str:
        """Return all that it has said, and the echo of what was typed."""
        return self._text_from(0)

    @property
    def answer(self) -> str:
        """Return what it has said since the last line typed, and that line."""
        return self._text_from(self._mark)

    def type(self, line: str) -> None:
        """Type a line; what is waited for from here on comes after it."""
        self._mark = len(self._heard)
        os.write(self._terminal, f"{line}\n".encode())

    def wait_for(self, pattern: str, *, within: float = PATIENCE) -> re.Match[str]:
        """Wait until it has said something that matches since the last line typed."""
        return wait_until(
            lambda: re.search(pattern, self.answer, re.MULTILINE),
            within=within,
            what=lambda: f"{pattern!r} in:\n{self.text}",
        )

    def ask(self, line: str, pattern: str, *, within: float = PATIENCE) -> re.Match[str]:
        """Type a line and wait for an answer that matches."""
        self.type(line)
        return self.wait_for(pattern, within=within)

    def wait_for_mode(self, name: str, *, within: float = PATIENCE) -> None:
        """Wait until the prompt shows a mode."""

        def is_shown() -> bool:
            self.type("")
            time.sleep(PROMPT_WITHIN)
            return f"{name}> " in self.answer

        wait_until(is_shown, within=within, what=lambda: f"mode {name} in:\n{self.text}")

    def complaints(self, *, but: str = r"(?!)") -> list[str]:
        """Return the lines that say that something is wrong, but for those that match."""
        said = [line for line in self.text.splitlines() if not LINK.search(line)]
        return [line for line in said if COMPLAINT.search(line) and not re.search(but, line)]

    def link(self) -> dict[str, str]:
        """Ask for its own count of the link: state, packets, lost, loss (%)."""
        return self.ask("link", LINK.pattern).groupdict()

    def heard(self) -> list[Logged]:
        """Return the packets that have come, as far as its log is written."""
        log = (self._folder / "mav.tlog").read_bytes()
        packets: list[Logged] = []
        at = STAMP_LENGTH
        while at + HEADER_LENGTH <= len(log):
            assert log[at] == MAVLINK_2, at
            seq, system_id, component_id = log[at + 4 : at + 7]
            message_id = int.from_bytes(log[at + 7 : at + 10], "little")
            if system_id != ITS_SYSTEM:
                packets.append(Logged(system_id, component_id, seq, message_id))
            at += HEADER_LENGTH + log[at + 1] + CRC_LENGTH + STAMP_LENGTH
        return packets

    def end(self) -> None:
        """Let it end as a user does; it is killed if it does not."""
        if self.popen.poll() is None:
            with suppress(OSError):
                os.write(self._terminal, END_OF_FILE)
            with suppress(subprocess.TimeoutExpired):
                self.popen.wait(STOP_LIMIT)
        self.popen.kill()
        self.popen.wait(STOP_LIMIT)
        self._reader.join(STOP_LIMIT)
        os.close(self._terminal)

    def _text_from(self, mark: int) -> str:
        said = self._heard[mark:].decode("utf-8", errors="replace").replace("\r", "")
        return PROMPT.sub(r"\g<0>\n", said)

    def _read(self) -> None:
        with suppress(OSError):  # how a terminal ends whose other side is gone
            while said := os.read(self._terminal, 65536):
                self._heard += said


@contextmanager
def mavproxy(
    port: int, folder: Path, *options: str, prepare: Callable[[], None] = lambda: None
) -> Iterator[MavProxy]:
    """Run it while the block runs, connected to a UDP port; all that it writes is in the folder.

    ``prepare`` puts what it is to find there.
    """
    script = Path(sysconfig.get_path("scripts")) / "mavproxy.py"
    state = folder / "mavproxy"
    state.mkdir()
    prepare()
    terminal, its_side = pty.openpty()
    termios.tcsetwinsize(its_side, (50, 500))  # a longer line would be shown by its end alone
    popen = subprocess.Popen(
        [
            *(sys.executable, str(script), "--master", f"udpout:127.0.0.1:{port}"),
            *("--state-basedir", str(state), *options),
        ],
        stdin=its_side,
        stdout=its_side,
        stderr=its_side,
        cwd=folder,
        env={"PATH": os.environ["PATH"], "HOME": str(state), "TERM": "dumb"},
    )
    os.close(its_side)
    session = MavProxy(popen, terminal, state)
    try:
        yield session
    finally:
        session.end()
        (folder / "mavproxy.log").write_text(session.text, encoding="utf-8")
