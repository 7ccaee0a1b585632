"""Every file that the server or a command writes: who may read it, and whose link it follows.

Store, record of halts, telemetry log, record and keys are their owner's alone, with the folders
made for them, whatever the umask. Documents (plans, QGroundControl's actions, a sample of the
configuration) are as the umask says, like any document, and there as a whole or not at all.
"""

import os
import stat
from contextlib import closing, suppress
from pathlib import Path

import pytest
from typer.testing import CliRunner

from mav_tasks import write_plan
from mav_tasks.basics.errors import MavTasksError, StoreError
from mav_tasks.cli.app import app
from mav_tasks.config.settings import Recording, Retention, Settings
from mav_tasks.plans import PlanFile, read_plan
from mav_tasks.recording import observers
from mav_tasks.store.base import Store
from mav_tasks.store.opening import kind_of
from mav_tasks.tasks.events import VehicleSeen

SOMEBODY_ELSE = 12345  # a user's number
PLAN = PlanFile((), None, (), ())


def mode(path: Path) -> int:
    return stat.S_IMODE(path.lstat().st_mode)


def opened(path: Path) -> Store:
    return kind_of(str(path)).open_store(str(path), lambda: 0.0, Retention())


def command(*arguments: str) -> int:
    return CliRunner().invoke(app, arguments).exit_code


@pytest.mark.parametrize("umask", [0o000, 0o022, 0o077])
def test_records_are_their_owners_alone_and_documents_as_the_umask_says(
    tmp_path: Path, umask: int
) -> None:
    own, documents = tmp_path / "own", tmp_path / "documents"
    recording = Recording(tlog=f"{own}/a/logs", decisions=f"{own}/b/records")
    before = os.umask(umask)
    try:
        (tmp_path / "documents").mkdir()
        with closing(opened(own / "data" / "tasks.sqlite3")) as store:
            store.append([VehicleSeen(1, "found", 1.0)])
            for observer in observers(recording, Settings(), None, now=0.0):
                observer.close()
            ring = ("--keys", str(own / "keys" / "keys.toml"))
            assert command("keys", "add", "anna", "--role", "operator", *ring) == 0
            found = list(own.rglob("*"))  # also while it is open
            assert {path.name for path in found} >= {"tasks.sqlite3", "tasks.sqlite3.halts"}
            assert {mode(path) for path in found if path.is_file()} == {0o600}
            assert {mode(path) for path in found if path.is_dir()} == {0o700}
        write_plan(PLAN, documents / "way.plan")
        assert command("config", "init", str(documents / "sample.toml")) == 0
        assert command("qgc-actions", "--install", "--documents", str(documents)) == 0
        files = [path for path in documents.rglob("*") if path.is_file()]
        assert len(files) == 4
        assert {mode(path) for path in files} == {0o666 & ~umask}
    finally:
        os.umask(before)


def test_a_folder_that_is_there_keeps_its_mode(tmp_path: Path) -> None:
    tmp_path.chmod(0o750)
    for observer in observers(Recording(tlog=str(tmp_path)), Settings(), None, now=0.0):
        observer.close()
    assert mode(tmp_path) == 0o750


def test_a_store_is_not_made_where_anothers_link_leads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    link = tmp_path / "tasks.sqlite3"
    link.symlink_to(tmp_path / "disk")
    if (me := os.geteuid()) == 0:
        os.chown(link, SOMEBODY_ELSE, -1, follow_symlinks=False)
    else:  # our own links are another's to somebody else
        monkeypatch.setattr(os, "geteuid", lambda: me + 1)
    with pytest.raises(StoreError, match=r"tasks\.sqlite3: it is a symbolic link of another user"):
        opened(link)
    assert list(tmp_path.iterdir()) == [link]
    monkeypatch.undo()
    link.unlink()
    link.symlink_to(tmp_path / "disk")  # one's own
    opened(link).close()
    assert (tmp_path / "disk.halts").exists()


def test_nothing_is_written_through_a_link_beside_the_store(tmp_path: Path) -> None:
    for suffix in (".halts", "-wal", "-shm", "-journal"):
        for is_there in (False, True):
            folder = tmp_path / f"{suffix}{is_there}"
            folder.mkdir()
            path, victim, link = folder / "t.sqlite3", folder / "victim", f"t.sqlite3{suffix}"
            victim.write_text("precious", encoding="utf-8")
            if is_there:
                opened(path).close()
                (folder / link).unlink(missing_ok=True)
            (folder / link).symlink_to(victim)
            with suppress(StoreError), closing(opened(path)) as store:
                assert suffix != ".halts"
                store.append([VehicleSeen(1, "found", 1.0)])
            assert victim.read_text("utf-8") == "precious", folder.name


def test_a_sample_of_the_configuration_writes_over_nothing(tmp_path: Path) -> None:
    path = tmp_path / "mav-tasks.toml"
    path.symlink_to(tmp_path / "victim")
    assert command("config", "init", str(path)) != 0
    assert not (tmp_path / "victim").exists()


def test_a_document_is_replaced_as_a_whole_and_keeps_its_mode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, link = tmp_path / "way.plan", tmp_path / "link.plan"
    path.write_text("old", encoding="utf-8")
    path.chmod(0o640)
    link.symlink_to(path)

    def full(_fd: int) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as disk:
        disk.setattr(os, "fsync", full)
        with pytest.raises(MavTasksError, match="No space"):
            write_plan(PLAN, path)
    assert path.read_text("utf-8") == "old"
    write_plan(PLAN, link)
    assert (link.is_symlink(), mode(path)) == (True, 0o640)
    assert read_plan(path).items == ()
    assert sorted(tmp_path.iterdir()) == [link, path]


def test_what_is_no_file_is_written_to_as_it_is(tmp_path: Path) -> None:
    device = tmp_path / "null.plan"
    device.symlink_to(os.devnull)
    write_plan(PLAN, device)
    assert not Path(os.devnull).is_file()
    ring = tmp_path / "ring.plan"
    ring.symlink_to(ring)
    with pytest.raises(MavTasksError, match="links"):
        write_plan(PLAN, ring)
