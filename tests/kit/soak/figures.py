"""Figures of a life, for adding up."""

from collections import Counter
from dataclasses import dataclass, field

COUNTED = ("faults", "deeds", "halts", "refused", "broken")


@dataclass
class Figures:
    """Sums over one life, or over many."""

    lives: int = 0
    virtual: float = 0.0  # s
    cpu: float = 0.0  # s
    tasks: int = 0
    packets: int = 0
    restarts: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    deeds: Counter[str] = field(default_factory=Counter)  # of attackers
    halts: Counter[str] = field(default_factory=Counter)  # acknowledged, or at the rover
    refused: Counter[str] = field(default_factory=Counter)  # go requests
    in_flight: int = 0  # go requests that crossed a halt in transit
    broken: Counter[str] = field(default_factory=Counter)  # breaches of the halt rule

    def add(self, other: "Figures") -> None:
        """Add the figures of another life."""
        self.lives += other.lives
        self.virtual += other.virtual
        self.cpu += other.cpu
        self.tasks += other.tasks
        self.packets += other.packets
        self.restarts += other.restarts
        self.in_flight += other.in_flight
        for name in COUNTED:
            getattr(self, name).update(getattr(other, name))

    def lines(self) -> list[str]:
        """Return the figures as lines of text."""
        return [
            f"lives        {self.lives}",
            f"virtual      {self.virtual:.0f} s",
            f"processor    {self.cpu:.1f} s",
            f"tasks        {self.tasks}",
            f"packets      {self.packets}",
            f"restarts     {self.restarts}",
            *_counted("faults", self.faults),
            *_counted("attacks", self.deeds),
            *_counted("halts", self.halts),
            *_counted("go refused", self.refused),
            f"in flight    {self.in_flight}",
            *_counted("RULE BROKEN", self.broken),
        ]


def _counted(title: str, counts: Counter[str]) -> list[str]:
    width = max(map(len, counts), default=0)
    each = (f"  {name:<{max(22, width)}} {count}" for name, count in sorted(counts.items()))
    return [f"{title:<12} {counts.total()}", *each]
