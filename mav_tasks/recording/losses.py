"""Says once that something is being lost, and once, with the count, that this is over."""

import logging

log = logging.getLogger("mav_tasks")


class Losses:
    """What one cause loses of one record. One thread counts; another may say that it is over."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._count = 0
        self._told = 0
        self.is_losing = False

    def __repr__(self) -> str:
        return f"Losses({self._name}, {self._count})"

    def lose(self, count: int, why: str) -> None:
        """Note that so many packets are lost."""
        self._count += count
        if not self.is_losing:
            self.is_losing = True
            log.warning("%s: %s: packets are lost", self._name, why)

    def over(self) -> None:
        """Note that nothing is being lost any more."""
        if self.is_losing:
            self.is_losing = False
            count = self._count
            log.warning("%s: is written again; %d packets are lost", self._name, count - self._told)
            self._told = count

    def end(self) -> None:
        """Say what is lost for good."""
        if self.is_losing:
            log.warning("%s: ends; %d packets are lost", self._name, self._count - self._told)
