"""Every file that the server or a command writes: who may read it, and whose link it follows.

Store, record of halts, telemetry log, record, keys and profiles are their owner's alone, with the
folders made for them, whatever the umask. Documents (plans, QGroundControl's actions, a sample of
the configuration) are as the umask says, like any document, and there as a whole or not at all.
"""

import os
import stat
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

import pytest
from typer.testing import CliRunner

from mav_tasks.cli.app import app
from mav_tasks.config import profiles
from mav_tasks.errors import StoreError
from mav_tasks.key_ring.ring import Entry
from mav_tasks.key_ring.ring_file import change
from mav_tasks.mavlink.signing import Key
from mav_tasks.plan_files import PlanFile, read_plan, write_plan
from mav_tasks.qgc_actions import ACTIONS, install
from mav_tasks.recording.decisions import Decisions
from mav_tasks.recording.new_files import prepared
from mav_tasks.recording.tlog_files import TlogFiles
from mav_tasks.settings import Settings, VehicleProfile
from mav_tasks.store.sqlite import SqliteStore
from mav_tasks.whole_file import write_whole
from tests.unit.store.samples import opened, submitted, wait_for

UMASKS = pytest.mark.parametrize("umask", [0o000, 0o022, 0o077])
SOMEBODY_ELSE = 12345  # a user's number
PLAN = PlanFile((), None, (), ())


@contextmanager
def masked(umask: int) -> Iterator[None]:
    before = os.umask(umask)
    try:
        yield
    finally:
        os.umask(before)


def mode(path: Path) -> int:
    return stat.S_IMODE(path.lstat().st_mode)


def modes_below(folder: Path) -> tuple[set[int], set[int]]:
    """Return the modes of all files and of all folders."""
    found = list(folder.rglob("*"))
    files = {mode(path) for path in found if path.is_file()}
    return files, {mode(path) for path in found if path.is_dir()}


# what is its owner's alone


def write_store(folder: Path) -> None:
    with opened(folder / "data" / "own" / "tasks.sqlite3") as store:
        store.append([submitted(1)])
        wait_for(store, 1)
        names = {path.name for path in (folder / "data" / "own").iterdir()}
        assert names >= {"tasks.sqlite3", "tasks.sqlite3.halts", "tasks.sqlite3-wal"}
        assert modes_below(folder) == ({0o600}, {0o700})  # also while it is open


def write_tlog(folder: Path) -> None:
    files = TlogFiles(prepared(str(folder / "own" / "records")), size=100, count=10)
    files.write([b"x" * 90, b"x" * 90], utc=0.0)
    files.close()


def write_record(folder: Path) -> None:
    made = prepared(str(folder / "records"))
    Decisions(made, Settings(), None, now=0.0, size=100_000).close()


def write_ring(folder: Path) -> None:
    anna = Entry("anna", "operator", Key("anna", bytes(range(32)), "operator"))
    change(folder / ".config" / "mav-tasks" / "keys.toml", lambda ring: ring.with_added(anna))


def write_profile(folder: Path) -> None:
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("XDG_CONFIG_HOME", str(folder / ".config"))
        profiles.write(VehicleProfile(1), None)


@UMASKS
@pytest.mark.parametrize(
    "write", [write_store, write_tlog, write_record, write_ring, write_profile]
)
def test_records_are_their_owners_alone_whatever_the_umask(
    tmp_path: Path, umask: int, write: Callable[[Path], None]
) -> None:
    with masked(umask):
        write(tmp_path)
    assert modes_below(tmp_path) == ({0o600}, {0o700})


def test_a_folder_that_is_there_keeps_its_mode(tmp_path: Path) -> None:
    folder = tmp_path / "shared"
    folder.mkdir()
    folder.chmod(0o750)
    write_tlog(tmp_path)
    assert prepared(str(folder)) == folder
    assert mode(folder) == 0o750


# links of others


def planted(link: Path, target: Path) -> None:
    """Make a link that is another user's."""
    link.symlink_to(target)
    if os.geteuid() == 0:
        os.chown(link, SOMEBODY_ELSE, -1, follow_symlinks=False)


@pytest.fixture
def as_another(monkeypatch: pytest.MonkeyPatch) -> None:
    """Be somebody to whom our own links are another's; root need not, it gives them away."""
    if (me := os.geteuid()) != 0:
        monkeypatch.setattr(os, "geteuid", lambda: me + 1)


@pytest.mark.usefixtures("as_another")
def test_a_store_is_not_made_where_anothers_link_leads(tmp_path: Path) -> None:
    victim, link = tmp_path / "victim", tmp_path / "tasks.sqlite3"
    planted(link, victim)
    with pytest.raises(StoreError, match=r"tasks\.sqlite3: it is a symbolic link of another user"):
        SqliteStore(link, wall_offset=lambda: 0.0)
    assert list(tmp_path.iterdir()) == [link]


def test_a_store_may_be_a_link_of_ones_own(tmp_path: Path) -> None:
    (tmp_path / "disk").mkdir()
    link = tmp_path / "tasks.sqlite3"
    link.symlink_to(tmp_path / "disk" / "tasks.sqlite3")
    with closing(SqliteStore(link, wall_offset=lambda: 0.0)):
        assert (tmp_path / "disk" / "tasks.sqlite3.halts").exists()


def test_the_record_of_halts_is_not_made_through_a_link(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("precious", encoding="utf-8")
    (tmp_path / "tasks.sqlite3.halts").symlink_to(victim)
    with pytest.raises(StoreError, match=r"tasks\.sqlite3\.halts"):
        SqliteStore(tmp_path / "tasks.sqlite3", wall_offset=lambda: 0.0)
    assert victim.read_text("utf-8") == "precious"


@pytest.mark.parametrize("is_there", [False, True])
@pytest.mark.parametrize("suffix", ["-wal", "-shm", "-journal"])
def test_sqlite_writes_nothing_through_a_link(tmp_path: Path, suffix: str, is_there: bool) -> None:
    path, victim = tmp_path / "tasks.sqlite3", tmp_path / "victim"
    victim.write_text("precious", encoding="utf-8")
    if is_there:
        SqliteStore(path, wall_offset=lambda: 0.0).close()
    (tmp_path / f"tasks.sqlite3{suffix}").symlink_to(victim)
    with suppress(StoreError), opened(path) as store:
        store.append([submitted(1)])
        wait_for(store, 1)
    assert victim.read_text("utf-8") == "precious"


def test_a_record_is_not_written_through_a_link(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    (tmp_path / "1970-01-01T00-00-00Z.tlog").symlink_to(victim)
    files = TlogFiles(tmp_path, size=100, count=10)
    files.write([b"x"], utc=0.0)
    files.close()
    assert not victim.exists()


# documents


def write_document(folder: Path) -> list[Path]:
    write_plan(PLAN, folder / "way.plan")
    return [folder / "way.plan"]


def write_actions(folder: Path) -> list[Path]:
    return install(folder, ACTIONS, component=191)


def write_sample(folder: Path) -> list[Path]:
    path = folder / "mav-tasks.toml"
    assert CliRunner().invoke(app, ["config", "init", str(path)]).exit_code == 0
    return [path]


@UMASKS
@pytest.mark.parametrize("write", [write_document, write_actions, write_sample])
def test_a_document_is_as_the_umask_says(
    tmp_path: Path, umask: int, write: Callable[[Path], list[Path]]
) -> None:
    with masked(umask):
        written = write(tmp_path)
    assert {mode(path) for path in written} == {0o666 & ~umask}


def test_a_sample_of_the_configuration_writes_over_nothing(tmp_path: Path) -> None:
    path = tmp_path / "mav-tasks.toml"
    path.symlink_to(tmp_path / "victim")
    done = CliRunner().invoke(app, ["config", "init", str(path)])
    assert done.exit_code != 0
    assert not (tmp_path / "victim").exists()


def test_a_document_that_is_replaced_keeps_its_mode_and_leaves_nothing_beside_it(
    tmp_path: Path,
) -> None:
    path = tmp_path / "way.plan"
    path.write_text("old", encoding="utf-8")
    path.chmod(0o640)
    write_plan(PLAN, path)
    assert mode(path) == 0o640
    assert read_plan(path).items == ()
    assert list(tmp_path.iterdir()) == [path]


def test_a_document_is_there_as_a_whole_or_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "way.plan"
    path.write_text("old", encoding="utf-8")

    def full(_fd: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        write_whole(path, "new")
    assert path.read_text("utf-8") == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_link_to_a_document_stays_one(tmp_path: Path) -> None:
    path, link = tmp_path / "way.plan", tmp_path / "link.plan"
    link.symlink_to(path)
    write_whole(link, "new")
    assert link.is_symlink()
    assert path.read_text("utf-8") == "new"


def test_what_is_no_file_is_written_to_as_it_is(tmp_path: Path) -> None:
    write_whole(Path(os.devnull), "new")
    assert not Path(os.devnull).is_file()
    ring = tmp_path / "ring"
    ring.symlink_to(ring)
    with pytest.raises(OSError, match="links"):
        write_whole(ring, "new")
