"""What the person at the screen sees, plus violations, each with its time."""

from collections import defaultdict
from typing import Any, NamedTuple

CRITICAL = 3  # MAV_SEVERITY: up to ERROR a box on the map [4]
TAB = "\t"


class Shown(NamedTuple):
    """One shown text with its time."""

    at: float
    text: str


class Screen:
    """Everything that was shown; a run without trouble leaves ``popups`` empty."""

    def __init__(self) -> None:
        self.popups: list[Shown] = []
        #: texts of the vehicle up to a warning, with their severity
        self.texts: list[tuple[Shown, int]] = []
        #: in the bar, and spoken: link lost or regained
        self.notices: list[Shown] = []
        #: not shown: what no ground station should receive, or have to do
        self.violations: list[Shown] = []

    @property
    def complaints(self) -> list[str]:
        """Popups and violations, in words."""
        return [f"{each.at:.2f} {each.text}" for each in self.popups + self.violations]


class Texts:
    """Turns STATUSTEXTs into shown texts: joins chunks, drops duplicates of events."""

    def __init__(self, screen: Screen, *, drops_tabs: bool) -> None:
        self._screen = screen
        self._drops_tabs = drops_tabs
        self._pieces: dict[int, dict[int, str]] = defaultdict(dict)  # by component, number
        self._open: dict[int, tuple[int, int]] = {}  # by component: id, severity

    def receive(self, message: Any, component: int, *, now: float) -> None:
        """Take one chunk; a chunk that is not full ends a text [4]."""
        text: str = message.text
        if self._open.get(component, (message.id, 0))[0] != message.id:
            self._finish(component, now)
        if message.id == 0:
            self._show(text, message.severity, now)
            return
        self._open[component] = message.id, message.severity
        self._pieces[component][message.chunk_seq] = text
        if len(text.encode()) < 50:
            self._finish(component, now)

    def give_up(self, component: int, message_id: int, *, now: float) -> None:
        """Show a text whose last chunk did not arrive."""
        if self._open.get(component, (0, 0))[0] == message_id:
            self._finish(component, now)

    def _finish(self, component: int, now: float) -> None:
        opened = self._open.pop(component, None)
        pieces = self._pieces.pop(component, None)
        if opened is None or not pieces:
            return
        text = "".join(pieces.get(number, " ... ") for number in range(max(pieces) + 1))
        self._show(text, opened[1], now)

    def _show(self, text: str, severity: int, now: float) -> None:
        if self._drops_tabs and text.endswith(TAB):
            return  # [4], [11.5]: PX4 also sends it as an event
        if severity <= CRITICAL:
            self._screen.popups.append(Shown(now, text))
        else:
            self._screen.texts.append((Shown(now, text), severity))
