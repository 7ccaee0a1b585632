"""Which link and endpoint leads to a system. MAVLink guide, "Routing"."""

from collections.abc import Hashable

Place = tuple[str, Hashable]  # link name, endpoint on it


class Router:
    """Systems on the vehicle links, by the place where they were first heard."""

    def __init__(self) -> None:
        self._places: dict[int, Place] = {}

    def learn(self, system_id: int, place: Place) -> None:
        """Note where a system is; a later place replaces an earlier one."""
        self._places[system_id] = place

    def forget(self, system_id: int) -> None:
        """Forget where a system is."""
        self._places.pop(system_id, None)

    def place_of(self, system_id: int) -> Place | None:
        """Return where a system was heard."""
        return self._places.get(system_id)
