"""The command line of the field trial, before anything is driven."""

import pytest

from rover_sim.field_trial.app import USAGE, main

URL = "udpout:127.0.0.1:14580"


def test_it_says_the_room_that_it_needs_and_drives_nowhere_without_a_yes(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("builtins.input", lambda _question: "")
    assert main([URL, "--only", "tasks"]) == USAGE
    assert "tasks: 36 m ahead" in capsys.readouterr().out


def test_a_row_that_there_is_not_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main([URL, "--only", "tasks,fly"])
    assert "--only fly" in capsys.readouterr().err
