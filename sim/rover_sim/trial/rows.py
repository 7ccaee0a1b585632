"""The rows of the trial's table, in their order, and what each needs."""

from collections.abc import Awaitable, Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from functools import partial

from mav_tasks.basics.errors import ClientError
from rover_sim.trial import restarts, stopping, tasks
from rover_sim.trial.session import NotTried, Result, Session, TrialError

AHEAD = "10 m ahead"


class Verdict(Enum):
    """The verdict on a row."""

    PASS = "PASS"
    FAIL = "FAIL"
    NOT_TRIED = "NOT TRIED"


@dataclass(frozen=True, slots=True)
class Kind:
    """One row: its name on the command line, what is tried, the room it needs, and how it runs."""

    name: str
    tried: str
    room: str
    run: Callable[[Session], Awaitable[Result]]

    @property
    def title(self) -> str:
        """Its name, and which of those with that name it is."""
        return f"{self.name}{self.tried.partition(',')[2]}"


@dataclass(frozen=True, slots=True)
class Row:
    """One row, and what came of it. ``begun`` and ``ended``: times of the rover's track, s."""

    kind: Kind
    verdict: Verdict
    result: Result
    begun: float = 0.0
    ended: float = 0.0


KINDS = (
    Kind("boot", "3 tasks in the first 5 s of its boot", AHEAD, restarts.boot),
    Kind("stop", "STOP at 1 m/s", "40 m ahead, or 20 m with --stop-distance", stopping.stop),
    Kind(
        "restart",
        "orderly restart of the server (SIGTERM) in mid-move",
        AHEAD,
        partial(restarts.restart, is_killed=False),
    ),
    Kind(
        "kill",
        "SIGKILL of the server in mid-move",
        AHEAD,
        partial(restarts.restart, is_killed=True),
    ),
    Kind("reboot", "restart of the rover in mid-task", AHEAD, restarts.reboot),
    Kind(
        "tasks",
        "30 tasks",
        "36 m ahead, 15 m behind and 18 m to each side of where it stands",
        tasks.drive_tasks,
    ),
    *(
        Kind(
            "stick",
            f"throttle stick pushed forward, {when}",
            AHEAD,
            partial(stopping.stick, when=when),
        )
        for when in ("starting", "driving", "cancelled")
    ),
)
#: names and the room that each needs
ROOM = {kind.name: kind.room for kind in KINDS}


async def run_rows(
    session: Session, only: Collection[str] = tuple(ROOM), *, done: Callable[[Row], None]
) -> None:
    """Run rows and call ``done`` with each; each leaves the rover ready for the next one."""
    if "stop" in only and session.best is None:
        session.say("stop: measuring the shortest distance, without the server")
        session.best = await stopping.measure(session)
    await session.begin()
    for kind in KINDS:
        if kind.name in only:
            done(await _run(session, kind))


async def _run(session: Session, kind: Kind) -> Row:
    session.say(f"{kind.name}: {kind.tried}")
    begun = session.now
    try:
        result = await kind.run(session)
    except NotTried as error:
        return Row(kind, Verdict.NOT_TRIED, Result(str(error), holds=False))
    except (ClientError, TrialError) as error:
        result = Result(str(error), holds=False)
    if not result.holds:
        with suppress(ClientError, TrialError):
            await session.clean()
    verdict = Verdict.PASS if result.holds else Verdict.FAIL
    return Row(kind, verdict, result, begun, session.now)


def table(rows: Sequence[Row]) -> list[str]:
    """Return the table in Markdown, a line each, with columns of minimal width."""
    head = ("row", "tried", "result", "figure", "limit", "verdict")
    cells = [head, *(_cells(row) for row in rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = [[c.ljust(w) for c, w in zip(line, widths, strict=True)] for line in cells]
    lines.insert(1, ["-" * width for width in widths])
    return [f"| {' | '.join(line)} |" for line in lines]


def _cells(row: Row) -> tuple[str, ...]:
    words, _, figure, limit = (str(each).replace("|", "/") for each in row.result)
    return row.kind.title, row.kind.tried, words, figure, limit, row.verdict.value
