from inspect import cleandoc

import pytest

from mav_tasks.cli.commands import COMMANDS
from mav_tasks.cli.lazy import LazyCommand

LAZY = [each for each in COMMANDS if isinstance(each, LazyCommand)]


@pytest.mark.parametrize("command", LAZY, ids=lambda each: str(each.name))
def test_the_help_of_all_commands_says_what_that_of_each_begins_with(command: LazyCommand) -> None:
    own = command.load()
    assert cleandoc(own.help).splitlines()[0] == command.help


def test_each_command_has_its_own_name() -> None:
    assert len({each.name for each in COMMANDS}) == len(COMMANDS)
