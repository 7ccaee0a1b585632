"""Kinds that one line of a registry adds: the server and every command use them."""

import os
import subprocess
import sys
from pathlib import Path

from tests.kit.processes import stand, submit, wait_until

MODULE = "tests.kit.with_third_kinds"
MOVE = 54000


def lines_of(*arguments: str, folder: Path) -> list[str]:
    """Run a command with the third kinds; return the lines of its output."""
    done = subprocess.run(
        [sys.executable, "-m", MODULE, *arguments],
        capture_output=True,
        text=True,
        check=True,
        timeout=40,
        env={**os.environ, "XDG_STATE_HOME": str(folder), "XDG_CONFIG_HOME": str(folder)},
    )
    return done.stdout.splitlines()


def test_a_third_kind_of_store_outlives_its_server_and_is_read_by_every_command(
    tmp_path: Path,
) -> None:
    store = f"shelf:{tmp_path / 'shelf'}"
    with stand(tmp_path, module=(MODULE,), serve_store=store) as running:
        running.server.wait_for("store shelf shelf, 0 tasks")
        assert submit(running.connect(), MOVE, 0.1) == 1
        running.server.wait_for("task 1 .*completed")
    with stand(tmp_path, module=(MODULE,), serve_store=store) as running:
        running.server.wait_for("store shelf shelf, 1 tasks")
        history = "history", "--server", f"udpout:127.0.0.1:{running.client_port}"
        wait_until(
            lambda: "the last finished task" in lines_of(*history, folder=tmp_path)[0],
            within=20,
            what="the finished task",
        )
        journal = lines_of("log", "--store", store, "--task", "1", folder=tmp_path)
        assert "task 1" in journal[0]
        assert (
            lines_of("log", "--task", "1", folder=tmp_path) == journal
        )  # the store of the latest server


def test_a_third_kind_of_link_is_served_and_dialled(tmp_path: Path) -> None:
    path = tmp_path / "server"
    options = "--client", f"unixin:{path}"
    with stand(tmp_path, *options, module=(MODULE,)) as running:
        running.server.wait_for(f"clients on unixin:{path}\n")
        shown = lines_of("vehicles", "--json", "--server", f"unix:{path}", folder=tmp_path)
        assert '"vehicle": 1' in shown[0]
