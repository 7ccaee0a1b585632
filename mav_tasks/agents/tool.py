"""One tool: what agents read about it, and what it does. Pure."""

from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mav_tasks.agents.rovers import Rovers
from mav_tasks.config.setting_keys.parts import Part

Values = dict[str, Any]  # of all arguments; None: not given
#: takes the part that is done, 0 to 1, and what happens
Report = Callable[[float, str], Awaitable[None]]
Run = Callable[[Rovers, Values, Report], Awaitable[Mapping[str, Any]]]


@dataclass(frozen=True, slots=True)
class Tool:
    """A tool. ``returns`` is the schema of what ``run`` returns.

    ``is_reading``: it changes nothing. ``is_destructive``: it moves a rover, or ends or drops
    something. ``makes_a_task``: it returns a new task.
    """

    name: str
    title: str
    about: str
    arguments: Sequence[Part]
    returns: Mapping[str, Any]
    run: Run
    is_reading: bool = False
    is_destructive: bool = False
    makes_a_task: bool = False
