"""The I/O shell of a probe: a link driver, and signals. It decides nothing.

However the probe ends, it sends zero velocity, HOLD and disarming. Only after SIGKILL it cannot:
then the rover's own setpoint time-out must stop the rover.
"""

import asyncio
import signal
from collections.abc import Callable

from mav_tasks.basics.errors import LinkDown
from mav_tasks.client.link_driver import LinkDriver
from mav_tasks.client.signatures import ClientSignatures
from mav_tasks.links.base import Link
from mav_tasks.links.link_limits import TO_VEHICLES
from mav_tasks.links.policy import unsigned_beyond
from mav_tasks.links.url import parse_url
from mav_tasks.mavlink.signing import Key
from mav_tasks.probe.probe import NothingHeard, Options, Probe

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
LAST_WORDS = 3  # times that the emergency stop packets are sent: a datagram may be lost


async def run_probe(
    url: str,
    options: Options,
    *,
    insecure: bool,
    key: Key | None = None,
    on_stage: Callable[[str], None],
) -> tuple[Probe, int]:
    """Probe the rover at a link; return the finished probe, and the number of a signal or 0.

    With a ``key`` the probe signs its packets and drops packets that are not signed with the key.
    ``on_stage`` is called with a text for each stage. Raise LinkUrlError, LinkOpenError or
    InsecureLinkError if the link cannot be used, LinkDown if it never was up.
    """
    parsed = parse_url(url)
    if not (insecure or key is not None or parsed.is_nearby):
        raise unsigned_beyond(f"link {parsed}")
    link = parsed.open(limits=TO_VEHICLES)
    if link.note:
        on_stage(link.note)
    face = _Face(link, options, None if key is None else ClientSignatures(key), on_stage)
    try:
        await face.over
    finally:
        face.close()
    if isinstance(face.probe.error, NothingHeard) and face.is_down:
        raise LinkDown(f"{parsed} {face.is_down}")
    return face.probe, face.signal


class _Face(LinkDriver):
    """Runs a probe until it is over, or fails, or a signal ends it."""

    def __init__(
        self,
        link: Link,
        options: Options,
        signatures: ClientSignatures | None,
        on_stage: Callable[[str], None],
    ) -> None:
        loop = asyncio.get_running_loop()
        self.probe = Probe(options, now=loop.time())
        super().__init__(link, self.probe, signatures=signatures)
        self._on_stage = on_stage
        self._stage = ""
        self.over: asyncio.Future[None] = loop.create_future()
        self.signal = 0
        for number in SIGNALS:
            loop.add_signal_handler(number, self._on_signal, number)
        self.begin()

    def close(self) -> None:
        """Send the probe's emergency stop packets, if it has any, and close the link."""
        self._send_last_words()
        for number in SIGNALS:
            self._loop.remove_signal_handler(number)
        super().close()

    def _on_signal(self, number: int) -> None:
        if self.signal:  # a second signal ends at once; close() stops the rover
            self._finish()
            return
        self.signal = number
        words = f"ended by {signal.Signals(number).name}"
        self._step(lambda: self.probe.interrupt(words, now=self.now))

    def _step(self, step: Callable[[], None]) -> None:
        """Run a step; if it raises, send the emergency stop packets and end with the error."""
        if self.over.done():
            return
        try:
            super()._step(step)
        except Exception as error:  # noqa: BLE001  # the rover must be stopped first
            self._send_last_words()
            self.over.set_exception(error)
            return
        if self.probe.is_over:
            self._finish()
        elif self.probe.stage != self._stage:
            self._stage = self.probe.stage
            self._on_stage(self._stage)

    def _send_last_words(self) -> None:
        for _ in range(LAST_WORDS):
            for data in self.probe.emergency_stop_packets():
                self.send(data)

    def _finish(self) -> None:
        if not self.over.done():
            self.over.set_result(None)
