"""One record through both cores: what differs, and by which entry of the table that is meant."""

import json
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from .differences import Difference, Kind, differences
from .entries import After, Intended
from .intended import INTENDED
from .ledger import Ledger
from .motion import MotionWatch
from .new_core import NewCore, sent_of
from .story import Story
from .wire import Layouts, Sent
from .words import let_go

MOST_WAKE_UPS = 1_000  # that only the new core wants, between two inputs
BOTH = (Kind.MISSING, Kind.ADDED)
NOT_SAID = "and the other core does not say it in time"
MOVES = "after the runs had split, to a rover that the old core does not move"


@dataclass
class Compared:
    """What came of one record."""

    whose: str
    seconds: float = 0.0  # of its run that were compared
    inputs: int = 0
    packets: int = 0  # of the old core, compared
    left_out: int = 0  # of the old core, after the runs had diverged: seen for motion only
    skipped: int = 0  # wake-ups that only the old core wanted
    added: int = 0  # and only the new one
    intended: Counter[str] = field(default_factory=Counter)
    diverged: str = ""  # the entry, and when
    unexplained: list[str] = field(default_factory=list)  # the first of them in words
    unusable: str = ""  # why it could not be compared


class Comparison:
    """Reads what ``inside/expand`` says of one record, and runs this checkout's core beside it."""

    def __init__(
        self,
        whose: str,
        *,
        old: Layouts,
        new: Layouts,
        secrets: Mapping[str, bytes],
        table: tuple[Intended, ...] = INTENDED,
    ) -> None:
        """``old`` and ``new`` are the layouts of both revisions' messages."""
        self.result = Compared(whose)
        self._old, self._new = old, new
        self._secrets = secrets
        self._table = table
        self._sent: list[Sent] = []  # by the old core, in this instant
        self._counts_numbers = True
        self._is_over = False  # nothing is looked at any more
        self._is_split = False  # packets are not compared any more
        self._story = Story(new, is_restart=False)
        self._ledger = Ledger()
        self._promised = Ledger()  # what one core has said at a split, and the other will
        self._may_move = False
        self._motion = MotionWatch()
        self._began: float | None = None
        self._now = 0.0

    def run(self, lines: Iterator[str]) -> Compared:
        """Read to the line that says it is the end."""
        head = json.loads(next(lines))
        if isinstance(head, list):  # the end at once
            self.result.unusable = head[1]
            return self.result
        self._story.is_restart = head["restored"] is not None
        core, waiting, due = None, [], None
        for line in lines:
            values = json.loads(line)
            kind = values[0]
            if kind == "end":
                self._end(values[1])
                return self.result
            if kind == "task":
                waiting.append(values[1])
                continue
            if self._is_over:
                self.result.left_out += len(values[2]) if kind == "out" else 0
                continue
            try:
                if core is None:
                    core = NewCore(head, waiting, self._secrets)
                due = self._step(core, values, due)
                self.result.skipped, self.result.added = core.skipped, core.added
            except Exception as error:  # noqa: BLE001 - whatever it is, it is what is looked for
                text = f"{type(error).__name__}: {error}"
                self._fail(Difference(Kind.CRASHED, self._now, None, None, text))
        raise RuntimeError("the other revision's process ended")

    def _step(self, core: NewCore, values: list[Any], due: float | None) -> float | None:
        match values:
            case ["in", now, line]:
                self._wake(core, due, now)
                self._now = now
                self._story.took_in(line, now=now)
                self._began = now if self._began is None else self._began
                self.result.inputs += 1
                core.feed(line, now=now)
                return None
            case ["out", _, packets, events]:
                core.old_turn(events)
                self._sent += sent_of(packets, self._old)
                return None
            case ["next", due]:
                self._compare(core)
                return due if due is None else float(due)
            case _:
                raise ValueError(f"unknown: {values[0]!r}")

    def _wake(self, core: NewCore, due: float | None, until: float) -> None:
        """Wake the new core when it alone wants to be, between two instants of the old one."""
        if self._began is None or until <= self._now:
            return
        for _ in range(MOST_WAKE_UPS):
            times = core.wake_between(due, until)
            if not times:
                return
            self._now = times[0]
            self._compare(core)

    def _compare(self, core: NewCore) -> None:
        new = core.end_instant(self._new, now=self._now)
        old, self._sent = self._sent, []
        now = self._now
        if self._is_over:
            return
        self._motion.old(old, now=now)
        if self._is_split:
            self._look_on(old, new)
            return
        self.result.packets += len(old)
        self.result.seconds = now - (self._began if self._began is not None else now)
        if old or new:
            numbers = self._counts_numbers
            self._judge(differences(old, new, now=now, counts_numbers=numbers, story=self._story))
            self._story.sent(old, new, now=now)
        if not self._is_over and not self._is_split:
            for difference in self._ledger.overdue(now):
                self._fail(difference)
                return

    def _look_on(self, old: list[Sent], new: list[Sent]) -> None:
        """After a split, see that nothing is moved, and that both say what they are to say."""
        now = self._now
        self.result.left_out += len(old)
        for system in let_go(new, self._story, now=now):
            self._motion.let_go(system)
        moved = () if self._may_move else self._motion.unmatched(new, now=now)
        for sent in moved:
            self._fail(Difference(Kind.ADDED, now, None, sent, MOVES))
            return
        self._promised.pay(old, Kind.MISSING, by="")
        self._promised.pay(new, Kind.ADDED, by="")
        for difference in self._promised.overdue(now):
            self._fail(replace(difference, text=NOT_SAID))
            return

    def _judge(self, found: list[Difference]) -> None:
        for difference in found:
            entry = next((each for each in self._table if each.matches(difference)), None)
            if entry is None:
                self._fail(difference)
                return
            self.result.intended[entry.name] += 1
            if difference.kind is not Kind.CHANGED:
                self._counts_numbers = False
            if entry.after is After.MOVED:
                self._ledger.note(difference, by=entry.name, within=entry.within, owes=entry.owes)
            if entry.after is After.DIVERGES:
                self._split(entry, found)
                return

    def _split(self, entry: Intended, found: list[Difference]) -> None:
        self.result.diverged = f"{entry.name}, from {self._now:.3f} s on"
        self._is_split = True
        self._may_move = entry.may_move
        for difference in found if entry.told_within else ():
            if difference.name == "STATUSTEXT" and difference.kind is not Kind.RENUMBERED:
                self._promised.note(difference, by="", within=entry.told_within, owes=BOTH)

    def _fail(self, difference: Difference) -> None:
        self.result.unexplained = list(difference.lines())
        self._is_over = True

    def _end(self, said: str) -> None:
        """The old core's own replay may fail late: then nothing that was found counts."""
        if said != "same":
            whose = self.result.whose
            self.result = Compared(whose, unusable=said)
