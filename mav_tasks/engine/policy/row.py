"""A row of the policy table: the kind of a message or command, and the role that may send it."""

from dataclasses import dataclass
from enum import Enum

from mav_tasks.engine.clients.rights import OPERATOR


class Kind(Enum):
    """What a client's message may do to a rover; the value is its text in the printed table."""

    HALT = "stops the vehicle or its task"
    GO = "resumes, starts, arms, or changes the mode"
    MOTION = "moves the vehicle, or disturbs its motion"
    #: apart from MOTION, because by manual control a person takes a rover over from a task
    STICKS = "manual control; during a task a takeover"
    #: no drive command, but not known to be harmless: a servo, a camera, a position estimate
    ACTION = "has another immediate effect, which may lead to motion"
    WISH = "is stored or set; moves nothing by itself"
    #: apart from QUESTION, because it has no answer, and a dropped one is not reported
    TELL = "informs; needs no answer"
    QUESTION = "requests information"


MOVES_NOTHING = frozenset({Kind.HALT, Kind.WISH, Kind.TELL, Kind.QUESTION})


@dataclass(frozen=True, slots=True)
class Row:
    """The policy for one message or command from a client."""

    name: str
    kind: Kind
    #: the lowest role that may send it
    role: str
    #: what it is about, for the printed table
    about: str = ""
    #: only from a client granted control since the last halt (``motion_gate.why_not_moved``)
    needs_grant: bool = False
    #: the server handles it, at its own address and, as far as it claims that, at the rover's
    is_claimed: bool = False
    #: may change more than motion: the rover's limits, its software, its position estimate
    is_bound: bool = False
    #: counts as a request; otherwise its rate is limited only before parsing
    is_counted: bool = True
    #: its row where the server does not handle it: for another component, or not claimed
    elsewhere: "Row | None" = None

    @property
    def passed_on(self) -> "Row":
        """Row that applies when it is forwarded to a rover."""
        return (self.elsewhere or UNKNOWN) if self.is_claimed else self

    @property
    def passes_under_stop(self) -> bool:
        """Whether it is forwarded to a rover while STOP is in force."""
        return self.kind in MOVES_NOTHING

    @property
    def passes_beside_task(self) -> bool:
        """Whether it is forwarded to a rover that a task drives."""
        return self.kind is not Kind.MOTION


#: a number that no table lists counts as the most dangerous kind
UNKNOWN = Row("", Kind.MOTION, OPERATOR, "not listed")
