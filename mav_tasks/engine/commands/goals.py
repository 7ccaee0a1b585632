"""Parses commands into goals, terms and deduplication keys. Pure functions.

Takes our own commands, and the standard ones of clients that do not know this server. A Rejection
names the bad parameter.
"""

from functools import cache
from hashlib import blake2b
from math import isnan, nan
from struct import Struct

from mav_tasks.basics.errors import Rejection
from mav_tasks.config.settings import Driving
from mav_tasks.engine.policy import TASK_COMMANDS
from mav_tasks.engine.services.commands import Command
from mav_tasks.kinds import SingleGoal
from mav_tasks.kinds.commands import PARSERS
from mav_tasks.kinds.params import KNOWN_FRAMES, identifier, number, refuse_infinite, whole
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import DEFAULT_PRIORITY, MAX_DELAY, MAX_PRIORITY, Marks, Terms

R = TaskReason


_MARK = Struct("<BBHh7d")


def parse_command(
    command: Command,
    packet: bytes,
    driving: Driving,
    *,
    now: float,
    priority: int = DEFAULT_PRIORITY,
    is_cruising: bool = False,
) -> tuple[SingleGoal, Terms, Marks]:
    """Return a task command's goal and terms, and the keys by which a repeat is recognised.

    Raise Rejection that names a bad parameter.

    ``priority`` and ``is_cruising`` are for standard commands, which cannot name them.
    """
    if command.frame is not None and command.frame not in KNOWN_FRAMES:
        raise Rejection(R.BAD_FRAME, f"frame {command.frame} is unknown")
    goal = PARSERS[command.command](command, driving)
    if command.command not in TASK_COMMANDS:
        refuse_infinite(command)
        terms = _terms(priority, is_cruising=is_cruising)
        return goal, terms, marks_of(command, packet)
    marks = marks_of(command, packet, nonce=identifier(command, 4, "nonce"))
    after, delay = 0, 0.0
    if any(command.params[4:6]):
        after = identifier(command, 5, "run after")
        delay = number(command, 6, "start delay", low=0.0, high=MAX_DELAY, default=0.0)
    named = whole(command, 7, "priority", high=MAX_PRIORITY, default=DEFAULT_PRIORITY)
    start_at = now + delay if delay > 0 else None
    if after or start_at is not None:
        return goal, Terms(priority=named, after=after, start_at=start_at), marks
    return goal, _terms(named), marks


@cache  # nearly all are equal, and making them takes time
def _terms(priority: int, *, is_cruising: bool = False) -> Terms:
    return Terms(priority=priority, is_cruising=is_cruising)


def goal_of(command: Command, driving: Driving) -> SingleGoal:
    """Return the goal of a task command. Raise Rejection that names a bad parameter."""
    return PARSERS[command.command](command, driving)


def marks_of(command: Command, packet: bytes, *, nonce: int = 0) -> Marks:
    """Return the keys by which a repeated submission is recognised; NaN is equal to NaN.

    With a nonce the packet's digest is not needed.
    """
    params: tuple[float, ...] = command.params
    if isnan(sum(params)):  # at least one: NaN has many forms
        params = tuple(nan if isnan(p) else p for p in params)
    frame = -1 if command.frame is None else command.frame
    packed = _MARK.pack(*command.target, command.command, frame, *params)
    payload = blake2b(packed, digest_size=9).hexdigest()
    whole_packet = "" if nonce else blake2b(packet, digest_size=9).hexdigest()
    return Marks(nonce, payload, whole_packet)
