"""One exception tree; everything that this package raises on purpose is in it.

::

    MavTasksError
    ├── UsageError            the operator can mend it: one clear line, exit code 2
    │   ├── LinkUrlError      a link URL that says nothing we can open
    │   ├── LinkOpenError     the system refuses the link (port in use, no such host)
    │   ├── InsecureLinkError a link beyond loopback without a key
    │   ├── StoreError        a store that cannot be opened or read at start
    │   ├── PlanFileError     a mission file that cannot be read or understood
    │   └── SettingError      a value that a setting cannot have
    ├── Rejection             a request refused: reason code and words for the client
    └── IllegalTransition     our own mistake: a move that the lifecycle table lacks

Bytes from outside never raise: they are parsed to a value or counted (see ``mavlink``).
"""


class MavTasksError(Exception):
    """Root of the tree."""


class UsageError(MavTasksError):
    """What the operator asked for cannot be done; the text says what to change."""


class LinkUrlError(UsageError):
    """A link URL could not be understood."""


class LinkOpenError(UsageError):
    """The operating system refused to open a link."""


class InsecureLinkError(UsageError):
    """A link reachable from other machines, without a signing key."""


class StoreError(UsageError):
    """A store cannot be opened, or what it holds cannot be read.

    Only at start: what the disk does later is no exception but an outcome (``NotKept``).
    """


class PlanFileError(UsageError):
    """A mission file cannot be read, or what it says is not clear enough to drive.

    The text names the part of the file first: "item 3: latitude 91 not in -90..90".
    """


class SettingError(UsageError):
    """A value that a setting cannot have; the text names the setting and its range."""


class Rejection(MavTasksError):
    """A client's request refused.

    ``reason`` is a TASK_REASON number of the dialect (100 and above); the MAV_RESULT that goes on
    the wire follows from it by the table in ``engine/translate.py``, so that the task domain can
    refuse without knowing MAVLink. ``param`` is the parameter that is wrong, 1 to 7, 0 for none.
    """

    def __init__(self, reason: int, text: str, *, param: int = 0) -> None:
        super().__init__(text)
        self.reason = reason
        self.text = text
        self.param = param


class IllegalTransition(MavTasksError):
    """A task was moved along an edge that the lifecycle table does not have."""
