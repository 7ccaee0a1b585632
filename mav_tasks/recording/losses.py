"""Logs once that packets are being lost, and once, with their number, that this is over."""

import logging

log = logging.getLogger("mav_tasks")


class Losses:
    """The losses of one record by one cause. One thread counts; another may call ``over``."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._count = 0
        self._told = 0
        self.is_losing = False

    def __repr__(self) -> str:
        return f"Losses({self._name}, {self._count})"

    @property
    def count(self) -> int:
        """Number of packets lost since the start."""
        return self._count

    def lose(self, count: int, why: str) -> None:
        """Note that so many packets are lost."""
        self._count += count
        if not self.is_losing:
            self.is_losing = True
            log.warning("%s: packets are being lost: %s", self._name, why)

    def over(self) -> None:
        """Note that packets are written again."""
        if self.is_losing:
            self.is_losing = False
            count = self._count
            log.warning("%s: writing again; %d packets lost", self._name, count - self._told)
            self._told = count

    def end(self) -> None:
        """Log the losses that are not yet logged."""
        if self.is_losing:
            log.warning("%s: ends; %d packets lost", self._name, self._count - self._told)
