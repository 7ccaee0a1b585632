"""The components inside one vehicle's system, and the id that is left for the server."""

from mav_tasks.mavlink.address import AUTOPILOT, Address

PLACES = 4  # component ids that the server may use, from the configured one on


class Components(set[int]):
    """The components heard in one vehicle's system, among them the autopilot."""

    def __init__(self, system_id: int, *, first: int) -> None:
        super().__init__()
        self._places = [Address(system_id, first + number) for number in range(PLACES)]
        #: the task server's address inside this vehicle's system
        self.server = self._places[0]
        self.note(AUTOPILOT)

    def note(self, component_id: int) -> bool:
        """Note a component that was heard. Return whether the server's address changes by it."""
        before = self.server
        self.add(component_id)
        free = (place for place in self._places if place.component_id not in self)
        self.server = next(free, self._places[0])
        return self.server != before
