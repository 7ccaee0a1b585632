"""A server that ends, and another one that goes on with what is on the disk."""

from pathlib import Path
from shutil import copy

from tests.kit.store import PromptSqliteStore
from tests.kit.world import World

UTC = 1.8e9  # s, when the worlds begin
STOP_TIME = 6.0  # s, an abandoned rover's own time-out and its way to a stand


def restart(
    world: World,
    path: Path,
    *,
    well: bool = False,
    away: float = STOP_TIME,
    settles: float = 4.0,
    utc: float = UTC,
) -> None:
    """Let the server be killed, or end, and start another one on a copy of its store at ``path``.

    What lets go does not count just after that: it ``settles``.
    """
    store = world.server.store
    world.end_server()
    if well:
        store.close()
    again = path.with_name(f"{path.stem}+{path.suffix}")
    for suffix in ("", "-wal", ".halts"):
        if Path(f"{path}{suffix}").exists():
            copy(f"{path}{suffix}", f"{again}{suffix}")
    store.close()
    world.run(away)
    later = PromptSqliteStore(again, wall_offset=utc)
    world.start_server(later, later.load())
    world.run(settles)
