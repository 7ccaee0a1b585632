"""What the operator can mend is said in one clear line, exit code 2, never a traceback."""

import re
import socket
import subprocess
import sys
from dataclasses import astuple
from pathlib import Path

import pytest

from tests.kit.commands import called, mav_tasks
from tests.kit.processes import free_tcp_ports, free_udp_ports, process


def run(*arguments: str, store: str = ":memory:") -> tuple[int, str, str]:
    """Run ``mav-tasks`` to its end; gives exit code, standard output and error."""
    return astuple(mav_tasks(*arguments, MAV_TASKS_STORE=store, MAV_TASKS_CONFIG=""))


def assert_one_clear_line(result: tuple[int, str, str], *words: str) -> None:
    code, _, error = result
    assert code == 2, error
    assert len(error.strip().splitlines()) == 1, error
    for word in words:
        assert word in error


def test_a_port_in_use_is_named() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        result = run("serve", "--client", f"udpin:127.0.0.1:{port}", "--no-push")
        assert_one_clear_line(result, f"127.0.0.1:{port}", "in use", "ss -lntup")
        assert_one_clear_line(
            run("sim", "--port", str(port), "--body", "kinematic"), str(port), "in use"
        )


LINKS = """--client  => udpin:host:port
--vehicle tcp:no.such.host.invalid:5760 => no.such.host.invalid
--client serial:/dev/null:57600 => not a serial device
--client udpin:0.0.0.0:14560 => --insecure … signing key
--vehicle udpout:192.0.2.1:14580 => --insecure … signing key
--push 192.0.2.1:14550 => --insecure … signing key
--vehicle udpin:127.0.0.1:1?key=carl => no key 'carl' (usable keys: anna, rover)
--client udpin:127.0.0.1:1?key=ben => key ben was revoked on
--vehicle udpin:127.0.0.1:1?key=anna => key anna has role safety
--client udpin:127.0.0.1:1?key=rover => key rover has role vehicle
--gateway a => --gateway a needs --store postgresql:
--gateway a --store postgresql://nowhere.invalid/x => check the host's name in the URL
--gateway a --store postgresql:///x?host=/nowhere => is the server running there?"""


def test_what_is_wrong_with_a_link_is_said_in_one_line(tmp_path: Path) -> None:
    """That of URLs is in tests/unit/links."""
    ring = tmp_path / "keys.toml"
    said = "add ben --role safety; revoke ben; add anna --role safety; add rover --role vehicle"
    for words in said.split("; "):
        assert not called("keys", *words.split(), "--keys", str(ring)).status
    for row in LINKS.splitlines():
        arguments, _, told = row.partition(" => ")
        keys = ("--set", f"signing.keys={ring}") if "?key" in arguments else ()
        push = () if "--push" in arguments else ("--no-push",)
        client = f"--client udpin:127.0.0.1:{free_udp_ports(1)[0]}"  # others have the default port
        assert_one_clear_line(
            run("serve", *push, *f"{arguments} {client}".split(" "), *keys), *told.split(" … ")
        )


#: a package that is missing, a command, and how it ends
MISSING = """mcp mcp => mcp needs the package mcp: run pip install '.[mcp]'
mcap export x --mcap y => export needs the package mcap: run pip install '.[mcap]'
uvicorn web => the web page needs the package uvicorn: run pip install '.[web]'
xstatic.pkg.leaflet web --listen 127.0.0.1:0 => the web page needs the package XStatic-Leaflet"""
WITHOUT = """import sys
sys.modules[sys.argv.pop(1)] = None
from mav_tasks.cli.app import main
main()"""


def test_a_package_that_is_missing_is_named() -> None:
    for arguments, words in re.findall("(.*) => (.*)", MISSING):
        done = subprocess.run(
            [sys.executable, "-c", WITHOUT, *arguments.split()],
            capture_output=True,
            text=True,
            timeout=30,
            check=False,
        )
        assert_one_clear_line((done.returncode, "", done.stderr), words)


def test_insecure_is_allowed_when_it_is_said(tmp_path: Path) -> None:
    (port,) = free_udp_ports(1)
    with process(
        *("-m", "mav_tasks.cli", "serve", "--insecure", "--no-push"),
        *("--client", f"udpin:0.0.0.0:{port}", "--vehicle", "udpout:127.0.0.1:9"),
        folder=tmp_path,
        name="server",
    ) as server:
        server.wait_for(f"clients on udpin:0.0.0.0:{port}")
        server.end()
    assert server.popen.returncode == 0


def test_who_is_not_there_yet_is_waited_for(tmp_path: Path) -> None:
    """A rover that is started later, a radio that is plugged in later: and a serial line needs no
    --insecure.
    """
    (port,) = free_tcp_ports(1)
    serial, tcp = f"serial:{tmp_path / 'ttyLater'}:57600", f"tcp:127.0.0.1:{port}"
    with process(
        *("-m", "mav_tasks.cli", "serve", "--store", ":memory:"),
        *("--client", serial, "--vehicle", tcp),
        folder=tmp_path,
        name="server",
    ) as server:
        server.wait_for("links.push not used: no link for clients is UDP")
        server.wait_for(re.escape(f"link {serial} is not available yet: No such file"))
        server.wait_for(re.escape(f"link {tcp} is not available yet: Connection refused"))
        with socket.create_server(("127.0.0.1", port)) as rover:
            rover.settimeout(10)
            connection, _ = rover.accept()
            with connection:
                assert connection.recv(1) == b"\xfd"  # it is spoken to first
        assert server.end() < 1.0
    assert server.popen.returncode == 0
    assert (
        server.text.count("is not available yet") == 2
    )  # once for each, however often it was tried


def test_a_store_without_a_name_or_a_page_without_a_link_is_refused() -> None:
    (port,) = free_udp_ports(1)
    client = ("--client", f"udpin:127.0.0.1:{port}")
    assert_one_clear_line(run("serve", "--no-push", *client, "--store", ""), "--store", ":memory:")
    dialled = run("serve", "--web", "--client", "udpout:127.0.0.1:9")
    assert_one_clear_line(dialled, "--web needs a link for clients that listens")


@pytest.mark.parametrize("words", [("--sign", "anna", "queue"), ("submit", "--sign", "anna")])
def test_an_option_before_the_command_is_told_where_it_goes(words: tuple[str, ...]) -> None:
    code, _, error = run(*words)
    assert code == 2
    assert "--sign stands before the command" in error


def test_the_doctor_says_what_is_wrong_and_what_helps(tmp_path: Path) -> None:
    store = tmp_path / "tasks.sqlite3"
    store.touch(mode=0o644)
    configuration = tmp_path / "config.toml"
    (port,) = free_udp_ports(1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        in_use = f"udpin:127.0.0.1:{taken.getsockname()[1]}"
        configuration.write_text(
            f'[links]\nclients = ["{in_use}"]\nvehicles = ["serial:/dev/ttyUSB99:57600"]\n'
        )
        code, said, error = run(
            *("doctor", "--server", f"udpout:127.0.0.1:{port}", "--timeout", "0.3"),
            *("--config", str(configuration)),
            store=str(store),
        )
    assert (code, error) == (1, "")
    wrong = {line.split()[1]: line for line in said.splitlines() if line.startswith("WRONG")}
    assert "chmod 600" in wrong["store"]
    assert in_use in wrong["clients"]
    assert "no such device" in wrong["vehicles"]
    assert "mav-tasks serve" in wrong["server"]
    assert "ok     settings  valid" in said.splitlines()
