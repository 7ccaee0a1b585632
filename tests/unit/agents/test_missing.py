import pytest

from mav_tasks.cli import mcp
from tests.kit.commands import called


def test_without_the_extra_the_command_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(mcp, "find_spec", lambda _name: None)
    done = called("mcp")
    assert (done.status, done.output) == (2, "")
    assert done.error == (
        "mav-tasks: mcp needs the package mcp: run pip install '.[mcp]'"
        " in the folder of mav-tasks\n"
    )
