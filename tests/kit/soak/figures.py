"""What a life was made of, added up."""

from collections import Counter
from dataclasses import dataclass, field


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

    def add(self, other: "Figures") -> None:
        """Add another life's."""
        self.lives += other.lives
        self.virtual += other.virtual
        self.cpu += other.cpu
        self.tasks += other.tasks
        self.packets += other.packets
        self.restarts += other.restarts
        self.faults.update(other.faults)

    def lines(self) -> list[str]:
        """Give them in words, one line each."""
        return [
            f"lives        {self.lives}",
            f"virtual      {self.virtual:.0f} s",
            f"processor    {self.cpu:.1f} s",
            f"tasks        {self.tasks}",
            f"packets      {self.packets}",
            f"restarts     {self.restarts}",
            f"faults       {self.faults.total()}",
            *(f"  {name:<22} {count}" for name, count in sorted(self.faults.items())),
        ]
