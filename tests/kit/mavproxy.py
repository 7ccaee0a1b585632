"""The real MAVProxy, unmodified, at its command line in a pseudo-terminal.

Behaviour of release 1.8.75, from experiments and its source:

- It locks onto the address of the first autopilot's heartbeat, (N, 1), and ignores texts of all
  other components. ``--target-system N`` leaves the component at 0: commands go to (N, 0), and it
  shows the texts of the task server, as "AP: Task 1 done".
- It shows a COMMAND_ACK by name, "Got COMMAND_ACK: DO_SET_MODE: ACCEPTED". If it has no name for
  the command, it shows the whole message, with ``result_param2``.
- ``long NUMBER …`` fills missing parameters with 0, so a task has priority 0; it accepts "nan".
- It requests parameters by file transfer first, and by PARAM_REQUEST_LIST after a refusal: by
  itself if it has none yet, else on the next command. Without an answer it retries for 11 s.
- It reports a ``param set`` only if it failed.
- It truncates coordinates of ``wp``, ``fence`` and ``guided`` to 1e-7 degrees: 149.1657 is sent as
  149.1656999.
- ``mode NAME`` works for ArduPilot only: its table of PX4's modes has triples, and it treats one as
  a number ("required argument is not a float"). ``long DO_SET_MODE 1 4 3`` works.
- It announces a mode at most every 2 s. The prompt shows each mode, but it is written only with
  the next line; an empty line triggers it.
- For pymavlink, a message that its dialects lack comes from component 0 of system 0. Each one
  leaves a gap in its sender's sequence numbers, and is counted as lost.
- If a rover does not report its fence healthy, it says "fence breach", though there is none.
- If a rover restarts after half a minute or more, it says "Time has wrapped".
- ``exit`` needs an end of file instead of the next line, and its exit code is always 1.
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

STAMP_LENGTH = 8  # of a packet in a tlog, which includes sent packets
HEADER_LENGTH, CRC_LENGTH = 10, 2
MAVLINK_2 = 0xFD
ITS_SYSTEM = 255
END_OF_FILE = b"\x04"
#: Its messages about problems, its own findings as well as a rover's answers. After it has cleared
#: a list, it may say "re-requesting rally items []": no item is missing then.
COMPLAINT = re.compile(
    r"error|fail|time?d? ?out|no ack|no link|link \d+ down|\blost\b|unexpected|denied"
    r"|re-requesting (?!.*\[\])"
    r"|unsupported|reject|not in control|cancelled|traceback|exception|wrapped|breach|stale"
    r"|unknown|unable|invalid|duplicate|\bbad\b|not (?:available|found)|can't",
    re.IGNORECASE,
)
PATIENCE = 10.0  # s, for an answer
PROMPT_WITHIN = 0.1  # s, after a line
#: Output may follow on the same line.
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
    """A session: type a line, wait for its output."""

    def __init__(self, popen: subprocess.Popen[bytes], terminal: int, folder: Path) -> None:
        self.popen = popen
        self._terminal = terminal
        self._folder = folder
        self._heard = bytearray()
        self._mark = 0
        # Read continuously: with a full terminal it would block and lose packets.
        self._reader = threading.Thread(target=self._read, name="mavproxy", daemon=True)
        self._reader.start()

    @property
    def text(self) -> str:
        """All output, including the echo of typed lines."""
        return self._text_from(0)

    @property
    def answer(self) -> str:
        """The output since the last typed line, including that line."""
        return self._text_from(self._mark)

    def type(self, line: str) -> None:
        """Type a line; later waits look only at output after it."""
        self._mark = len(self._heard)
        os.write(self._terminal, f"{line}\n".encode())

    def wait_for(self, pattern: str, *, within: float = PATIENCE) -> re.Match[str]:
        """Wait until the output since the last typed line matches."""
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
        """Return the output lines about problems, except those that match ``but``."""
        said = [line for line in self.text.splitlines() if not LINK.search(line)]
        return [line for line in said if COMPLAINT.search(line) and not re.search(but, line)]

    def link(self) -> dict[str, str]:
        """Return MAVProxy's own count of the link: state, packets, lost, loss (%)."""
        return self.ask("link", LINK.pattern).groupdict()

    def heard(self) -> list[Logged]:
        """Return the received packets, as far as its log is written."""
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
        """End it like a user does; kill it if it does not end."""
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
        with suppress(OSError):  # raised when the other side is closed
            while said := os.read(self._terminal, 65536):
                self._heard += said


@contextmanager
def mavproxy(
    port: int, folder: Path, *options: str, prepare: Callable[[], None] = lambda: None
) -> Iterator[MavProxy]:
    """Run it for a ``with`` block, connected to a UDP port; it writes its files to the folder.

    ``prepare`` creates files that it reads.
    """
    script = Path(sysconfig.get_path("scripts")) / "mavproxy.py"
    state = folder / "mavproxy"
    state.mkdir()
    prepare()
    terminal, its_side = pty.openpty()
    termios.tcsetwinsize(its_side, (50, 500))  # it would show only the end of a longer line
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
