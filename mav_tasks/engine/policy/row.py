"""What a row of the policy table says: what kind of word something is, and who may say it."""

from dataclasses import dataclass
from enum import Enum

from mav_tasks.engine.clients.rights import OPERATOR


class Kind(Enum):
    """What a word of a client may do to a rover; the value is what the printed table says of it."""

    HALT = "lets the rover stand, or ends what it does"
    GO = "lets it go on, start, arm or change its mode"
    MOTION = "drives it, or keeps it from driving as it is told"
    #: apart from MOTION, because by sticks a person takes a rover out of a task's hands
    STICKS = "drives it by hand: beside a task a takeover"
    #: neither drives it nor is known not to: a servo, a camera, an estimate of where it is
    ACTION = "does something else, at once, that may end in motion"
    WISH = "is recorded or set, and moves nothing by itself"
    #: apart from QUESTION, because nobody answers, and nothing is said of one that goes no further
    TELL = "tells something"
    QUESTION = "asks something"


MOVES_NOTHING = frozenset({Kind.HALT, Kind.WISH, Kind.TELL, Kind.QUESTION})


@dataclass(frozen=True, slots=True)
class Row:
    """One message or command, as a client may send it."""

    name: str
    kind: Kind
    #: the least role that may send it
    role: str
    #: for whose words the row is: what it is about, for the printed table
    about: str = ""
    #: only from a client that was granted control since the last halt (``Vehicle.may_move``)
    needs_grant: bool = False
    #: the server sees to it itself, at its own address and, as far as it claims that, the rover's
    is_claimed: bool = False
    #: may change more than motion: what bounds the rover, what it runs, where it takes itself to be
    is_bound: bool = False
    #: counts as a request; else its rate is bounded where it comes in
    is_counted: bool = True
    #: what it is where the server does not see to it after all: another component's, or not claimed
    elsewhere: "Row | None" = None

    @property
    def passed_on(self) -> "Row":
        """Return what it is on its way to a rover."""
        return (self.elsewhere or UNKNOWN) if self.is_claimed else self

    @property
    def passes_under_stop(self) -> bool:
        """Whether it goes on to a rover while STOP is latched."""
        return self.kind in MOVES_NOTHING

    @property
    def passes_beside_task(self) -> bool:
        """Whether it goes on to a rover while a task drives that."""
        return self.kind is not Kind.MOTION


#: what is in no table is the most dangerous thing that it could be
UNKNOWN = Row("", Kind.MOTION, OPERATOR, "whatever is not named here")
