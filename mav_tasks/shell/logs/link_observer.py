"""What observers of links have in common: they look at each input, and log what they find."""

from collections.abc import Sequence

from mav_tasks.engine.inputs import AtOnce, Input, LinkChanged, LinkSide, Outgoing
from mav_tasks.tasks.events import Event


class LinkObserver:
    """Implements ``EngineObserver``, but for ``look``."""

    def __init__(self) -> None:
        self._links: dict[str, bool] = {}  # links to vehicles -> whether it is a stream

    def look(self, item: Input | None, *, now: float) -> None:
        """Look at one input; those that came at once are looked at one by one."""
        raise NotImplementedError

    def on_input(self, item: Input | None, *, now: float) -> None:
        """Look at what the links deliver."""
        if isinstance(item, AtOnce):
            for each in item.packets:
                self.on_input(each, now=now)
            return
        if isinstance(item, LinkChanged):
            self._links.pop(item.link, None)
            if item.side is LinkSide.VEHICLES and item.up:
                self._links[item.link] = item.is_stream
        self.look(item, now=now)

    def on_output(
        self, packets: Sequence[Outgoing], events: Sequence[Event], *, now: float
    ) -> None:
        """Ignore output: the engine's events are logged anyway."""

    def close(self) -> None:
        """Do nothing."""
