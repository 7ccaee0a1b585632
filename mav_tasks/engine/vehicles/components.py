"""The components inside one vehicle's system, and the id that is left for the server."""

from mav_tasks.mavlink.address import AUTOPILOT, Address

PLACES = 4  # component ids that the server may use, from the configured one on


class Components:
    """The components heard in one vehicle's system, among them the autopilot."""

    def __init__(self, system_id: int, *, first: int) -> None:
        self._system_id = system_id
        self._first = first
        self._own = {AUTOPILOT}
        #: the task server's address inside this vehicle's system
        self.server = self._free()

    def __repr__(self) -> str:
        return f"Components({sorted(self._own)}, server={self.server})"

    def __contains__(self, component_id: object) -> bool:
        return component_id in self._own

    def note(self, component_id: int) -> bool:
        """Note a component that was heard. Return whether the server's address changes by it."""
        before = self.server
        self._own.add(component_id)
        self.server = self._free()
        return self.server != before

    def _free(self) -> Address:
        numbers = range(self._first, self._first + PLACES)
        free = (number for number in numbers if number not in self._own)
        return Address(self._system_id, next(free, self._first))
