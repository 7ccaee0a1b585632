"""The model of the database: what it grants, one request at a time, as the SQL must."""

from dataclasses import dataclass, field

from mav_tasks.fleet.member import Evict, Free, Join, Request, Row, Take
from mav_tasks.fleet.rivals import Rival


@dataclass
class Gateway:
    """A gateway's row."""

    epoch: int
    renewals: int = 0
    holds: set[int] = field(default_factory=set)


@dataclass
class Database:
    """Rows of gateways, and who has a session. No clock."""

    rows: dict[str, Gateway] = field(default_factory=dict)
    sessions: dict[str, int] = field(default_factory=dict)  # by gateway, the session's number
    is_up: bool = True
    takeovers: int = 0
    _numbers: int = 0
    _epochs: int = 0

    def connect(self, name: str) -> int:
        """Begin a session; the gateway's earlier one has ended, with what it still asked."""
        self._numbers += 1
        self.sessions[name] = self._numbers
        return self._numbers

    def restart(self) -> None:
        """All sessions end; what was committed stays."""
        self.sessions.clear()

    def holder(self, vehicle: int) -> str | None:
        """Return who holds a vehicle."""
        holders = [name for name, row in self.rows.items() if vehicle in row.holds]
        assert len(holders) <= 1, holders
        return holders[0] if holders else None

    def execute(self, name: str, request: Request) -> Row:
        """Carry out a request of a gateway in its session; return the answer."""
        mine = self.rows.get(name)
        if isinstance(request, Join):
            self._epochs += 1
            mine = self.rows[name] = Gateway(self._epochs)
        else:
            by = request.by if isinstance(request, Evict | Take | Free) else request
            if mine is None or mine.epoch != by.epoch:
                return self._row(name, None)
            match request:
                case Evict(_, rival):
                    row = self.rows.get(rival.name)
                    if row is not None and (row.epoch, row.renewals) == (
                        rival.epoch,
                        rival.renewals,
                    ):
                        del self.rows[rival.name]
                        self.takeovers += 1
                case Take(_, vehicle):
                    if self.holder(vehicle) is None:
                        mine.holds.add(vehicle)
                case Free(_, vehicle):
                    mine.holds.discard(vehicle)
                case _:
                    mine.renewals += 1
        return self._row(name, mine)

    def _row(self, name: str, mine: Gateway | None) -> Row:
        rivals = tuple(
            Rival(each, row.epoch, row.renewals, each in self.sessions, frozenset(row.holds))
            for each, row in self.rows.items()
            if each != name
        )
        if mine is None:
            return Row(0, frozenset(), rivals)
        return Row(mine.epoch, frozenset(mine.holds), rivals)
