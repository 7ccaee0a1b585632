"""Exceptions that the simulator itself raises; bytes from outside never cause one.

Exception
├── MissingExtra       an optional dependency is not installed
├── SimulatedCrash     a message that makes the real autopilot abort
├── NotInVirtualTime   an operation that needs real time, on the virtual loop
└── Stalled            a test waits in virtual time for something that never happens
"""


class MissingExtra(Exception):
    """An optional dependency is missing; the message is one line with the remedy."""


class SimulatedCrash(Exception):
    """The real ArduPilot aborts on this message (floating point exception); so does a test."""


class NotInVirtualTime(Exception):
    """Sockets, processes and the like run in real time, which a virtual loop cannot wait for."""


class Stalled(Exception):
    """A wait in virtual time would never end; the message says who waits, and where."""
