"""What the simulator itself can raise; bytes from outside never do.

Exception
├── MissingExtra       an optional dependency is not installed
├── SimulatedCrash     a message that makes the real autopilot abort
├── NotInVirtualTime   something that needs real time, asked of a loop that has none
└── Stalled            what a test waits for in virtual time does not come
"""


class MissingExtra(Exception):
    """An optional dependency is missing; the message is one line with the remedy."""


class SimulatedCrash(Exception):
    """The real ArduPilot aborts on this message (floating point exception); so does a test."""


class NotInVirtualTime(Exception):
    """Sockets, processes and the like do not wait for virtual time, nor it for them."""


class Stalled(Exception):
    """Waiting in virtual time has no end; the message says who waits, and where."""
