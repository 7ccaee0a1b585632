"""What the simulator itself can raise; bytes from outside never do.

Exception
├── MissingExtra     an optional dependency is not installed
└── SimulatedCrash   a message that makes the real autopilot abort
"""


class MissingExtra(Exception):
    """An optional dependency is missing; the message is one line with the remedy."""


class SimulatedCrash(Exception):
    """The real ArduPilot aborts on this message (floating point exception); so does a test."""
