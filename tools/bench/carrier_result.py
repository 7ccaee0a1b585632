"""What one gateway of ``carrier`` has measured."""

import os
from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class Result:
    """Latencies in seconds; ``over``: by how much ``Arrived.waited`` was more than the truth."""

    sent: int = 0
    ordinary: list[float] = field(default_factory=list)
    stops: list[float] = field(default_factory=list)
    over: list[float] = field(default_factory=list)
    cpu: float = 0.0  # s


def cpu_seconds(pid: int | str) -> float:
    """Return the processor time that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
