"""The kinds of tasks: each file has what a kind is, its words, its JSON, and how it is sent.

SI units and radians; angles clockwise from north. Frozen values.
"""

from mav_tasks.kinds.act import Act
from mav_tasks.kinds.base import Leg, Unit
from mav_tasks.kinds.drive import Drive, Head
from mav_tasks.kinds.goto import GoTo
from mav_tasks.kinds.move import Move, MoveTurned
from mav_tasks.kinds.places import Bend, GlobalPlace, LocalPlace, Place, Pose
from mav_tasks.kinds.rotate import Face, Rotate
from mav_tasks.kinds.wait import Wait

#: a goal that drives on its own: a task's goal, or a step of a plan
SingleGoal = Move | MoveTurned | Rotate | Drive | GoTo | Face | Head | Wait | Act

__all__ = [
    "Act",
    "Bend",
    "Drive",
    "Face",
    "GlobalPlace",
    "GoTo",
    "Head",
    "Leg",
    "LocalPlace",
    "Move",
    "MoveTurned",
    "Place",
    "Pose",
    "Rotate",
    "SingleGoal",
    "Unit",
    "Wait",
]
