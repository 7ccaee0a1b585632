"""How each command becomes a goal: by the parser of its kind."""

from collections.abc import Callable, Mapping

from mav_tasks.config.settings import Driving
from mav_tasks.kinds import SingleGoal, drive, goto, move, rotate, wait
from mav_tasks.kinds.params import Given

#: by command; a parser raises Rejection that names a bad parameter
PARSERS: Mapping[int, Callable[[Given, Driving], SingleGoal]] = {
    **move.PARSERS,
    **rotate.PARSERS,
    **drive.PARSERS,
    **goto.PARSERS,
    **wait.PARSERS,
}
