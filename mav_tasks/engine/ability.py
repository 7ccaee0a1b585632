"""What a vehicle that is steered by course cannot drive: refused when it is asked for, by name."""

from dataclasses import replace

from mav_tasks.errors import Rejection
from mav_tasks.tasks.goal import Drive, Face, GoTo, Head, Move, Rotate, SingleGoal
from mav_tasks.tasks.lifecycle import TaskReason

TURNS = "this rover does not turn on the spot, nor at a rate"
REVERSES = "this rover does not reverse"


def as_driven(goal: SingleGoal, *, turns_on_spot: bool) -> SingleGoal:
    """Give a goal as such a vehicle drives it; Rejection when it cannot.

    A heading at the end of a way is left out, as its autopilot does: clients name one without
    meaning it.
    """
    if turns_on_spot:
        return goal
    match goal:
        case Rotate() | Face():
            raise _cannot(TURNS)
        case Move(distance=distance) if distance < 0:
            raise _cannot(f"param1 distance {distance:g}: {REVERSES}", param=1)
        case Drive(forward=forward) if forward < 0:
            raise _cannot(f"param1 forward speed {forward:g}: {REVERSES}", param=1)
        case Drive(yaw_rate=yaw_rate) if yaw_rate:
            raise _cannot(f"param2 yaw rate: {TURNS}", param=2)
        case Head(forward=forward) if forward < 0:
            raise _cannot(f"param2 speed {forward:g}: {REVERSES}", param=2)
        case Head(forward=0.0):
            raise _cannot(f"param2 speed 0: {TURNS}", param=2)
        case GoTo():
            return replace(goal, yaw=None)
    return goal


def _cannot(words: str, *, param: int = 0) -> Rejection:
    return Rejection(TaskReason.NOT_SUPPORTED_BY_VEHICLE, words, param=param)
