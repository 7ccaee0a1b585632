"""``mav-tasks config`` and what ``serve`` says of a configuration, without processes."""

import json
import re
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from mav_tasks.cli.app import main

Result = tuple[int, str, str]
Run = Callable[..., Result]


@pytest.fixture
def run(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> Iterator[Run]:
    """Return what runs a command line; gives exit code, standard output and error."""
    hangup = signal.getsignal(signal.SIGHUP)

    def command(*arguments: str, environment: dict[str, str] | None = None) -> Result:
        with monkeypatch.context() as context:
            variables = {"MAV_TASKS_STORE": ":memory:", "MAV_TASKS_CONFIG": ""}
            for name, value in {**variables, **(environment or {})}.items():
                context.setenv(name, value)
            with pytest.raises(SystemExit) as ended:
                main(arguments)  # given, or it would end this process as its own
        said = capsys.readouterr()
        return int(ended.value.code or 0), said.out, said.err

    yield command
    signal.signal(signal.SIGHUP, hangup)


def assert_one_clear_line(result: Result, *words: str) -> None:
    code, _, error = result
    assert code == 2, error
    assert len(error.splitlines()) == 1, error
    for word in words:
        assert word in error


def test_what_is_wrong_with_a_configuration_is_told_line_by_line(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    path.write_text("[driving]\nspeed = 50\nsped = 1\n", encoding="utf-8")
    wanted = [
        f"mav-tasks: {path}:2: driving.speed = 50: not in 0.05..10 m/s",
        f"mav-tasks: {path}:3: driving.sped: no such key; did you mean driving.speed?",
    ]
    for command in (("config", "check", str(path)), ("serve", "--config", str(path))):
        code, output, error = run(*command)
        assert (code, output, error.splitlines()) == (2, "", wanted)
    variable = {"MAV_TASKS_DRIVNG_SPEED": "1"}
    result = run("serve", environment=variable)
    assert_one_clear_line(result, "MAV_TASKS_DRIVNG_SPEED", "did you mean MAV_TASKS_DRIVING_SPEED?")
    expected = "--set driving.speed: expected driving.speed=VALUE"
    assert_one_clear_line(run("serve", "--set", "driving.speed"), expected)
    assert_one_clear_line(run("serve", "--keep-days", "-1"), "--keep-days=-1", "0..36500 days")
    assert_one_clear_line(run("config", "show", "driving.sped"), "did you mean driving.speed?")
    assert_one_clear_line(run("config", "check", str(tmp_path)), str(tmp_path), "not a file")


def test_what_is_in_force_is_shown_with_who_says_so(run: Run, tmp_path: Path) -> None:
    path, again = tmp_path / "c.toml", tmp_path / "again.toml"
    path.write_text("[driving]\nspeed = 0.8\n", encoding="utf-8")
    environment = {"MAV_TASKS_QUEUEING_QUOTA": "7", "MAV_TASKS_CONFIG": str(path)}
    code, output, error = run("config", "show", environment=environment)
    assert (code, error) == (0, "")
    assert re.search(r"^driving\.speed = 0\.8 +# m/s, .*c\.toml:2$", output, re.MULTILINE)
    assert re.search(r"^queueing\.quota = 7 +# MAV_TASKS_QUEUEING_QUOTA$", output, re.MULTILINE)
    assert re.search(r"^store\.path = \":memory:\" +# MAV_TASKS_STORE$", output, re.MULTILINE)
    assert re.search(r"^driving\.max_speed = 2 +# m/s, default$", output, re.MULTILINE)
    for store in (tmp_path, tmp_path, path, "~nobody.there/x"):
        done = run("config", "show", environment={"MAV_TASKS_STORE": str(store)})
        assert f"parameters set by clients are not shown: store {store}: " in done[2]
        Path(f"{tmp_path}-wal").touch()
    unknown = run("config", "show", "log", environment={"MAV_TASKS_STORE": "x://y"})
    assert "parameters set by clients are not shown" in unknown[2]
    again.write_text(output, encoding="utf-8")
    assert run("config", "check", str(again)) == (0, "ok\n", "")
    code, output, _ = run(
        "config", "show", "driving.speed", "log", "--json", environment=environment
    )
    told = json.loads(output)
    assert told["file"] == str(path)
    assert list(told["keys"]) == ["driving.speed", "log.format", "log.level"]
    assert told["keys"]["driving.speed"] == {
        "value": 0.8,
        "unit": "m/s",
        "source": "file",
        "where": f"{path}:2",
        "live": True,
    }
