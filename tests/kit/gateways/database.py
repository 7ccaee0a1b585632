"""The model of the database: what it grants, one request at a time, as the SQL must."""

from dataclasses import dataclass, field

from mav_tasks.fleet.member import Evict, Free, Join, Renew, Request, Row, Take
from mav_tasks.fleet.rivals import Eviction, Rival


@dataclass
class Gateway:
    """A gateway's row."""

    epoch: int
    session: int  # that joined, or has asked since
    renewals: int = 0
    holds: set[int] = field(default_factory=set)
    hears: frozenset[int] = frozenset()


@dataclass
class Database:
    """Rows of gateways, and who has a session. No clock."""

    rows: dict[str, Gateway] = field(default_factory=dict)
    sessions: dict[str, int] = field(default_factory=dict)  # by gateway, the session's number
    is_up: bool = True
    takeovers: int = 0
    _numbers: int = 0
    _epochs: int = 0

    def connect(self, name: str, earlier: int | None = None) -> int | None:
        """Begin a session; None: another process has one under this name.

        The process's own ``earlier`` one ends, with what it still asked.
        """
        if self.sessions.get(name) not in (None, earlier):
            return None
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
            if mine is not None and not self._is_as_read(request.replaced):
                return self._row(None)
            self._epochs += 1
            mine = self.rows[name] = Gateway(self._epochs, self.sessions[name])
            return self._row(mine)
        by = request if isinstance(request, Renew) else request.by
        if mine is None or mine.epoch != by.epoch:
            return self._row(None)
        mine.session = self.sessions[name]
        match request:
            case Renew(hears=hears):
                mine.renewals += 1
                mine.hears = hears
            case Evict(_, rival):
                if self._is_as_read(rival):
                    del self.rows[rival.name]
                    self.takeovers += 1
            case Take(_, vehicles):
                mine.holds |= {each for each in vehicles if self.holder(each) is None}
            case Free(_, vehicle):
                mine.holds.discard(vehicle)
        return self._row(mine)

    def _is_as_read(self, rival: Eviction | None) -> bool:
        row = self.rows.get(rival.name) if rival else None
        if row is None or rival is None:
            return False
        return (row.epoch, row.renewals) == (rival.epoch, rival.renewals)

    def _row(self, mine: Gateway | None) -> Row:
        rivals = tuple(
            Rival(
                name,
                row.epoch,
                row.renewals,
                self.sessions.get(name) == row.session,
                frozenset(row.holds),
                row.hears,
            )
            for name, row in self.rows.items()
            if row is not mine
        )
        if mine is None:
            return Row(0, frozenset(), rivals)
        return Row(mine.epoch, frozenset(mine.holds), rivals)
