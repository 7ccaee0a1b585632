"""One exception tree; everything that this package raises on purpose is in it.

::

    MavTasksError
    ├── UsageError            the operator can mend it: one clear line, exit code 2
    │   ├── LinkUrlError      a link URL that says nothing we can open
    │   ├── LinkOpenError     the system refuses the link (port in use, no such host)
    │   ├── InsecureLinkError a link beyond loopback without a key
    │   ├── StoreError        a store that cannot be opened or read at start
    │   ├── RecordError       records that cannot be kept, or one that cannot be read
    │   ├── PlanFileError     a mission file that cannot be read or understood
    │   ├── ConfigError       a configuration that cannot be read or is not valid: all its faults
    │   │   └── KeyRingError  a file of keys, the same; no secret is in the words
    │   └── SettingError      a value that a setting cannot have
    ├── Rejection             a request refused: reason code and words for the client
    ├── ClientError           what a script asked of a task server came to nothing
    │   ├── NoAnswer          nobody answered in time
    │   ├── Refused           the server said no, and why
    │   ├── NoSuchVehicle     it is not clear which rover is meant, or it is not there
    │   └── TaskFailed        a task ended in another way than completed
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


class RecordError(UsageError):
    """Records of a run cannot be kept where they are to be, or one of them cannot be read."""


class PlanFileError(UsageError):
    """A mission file cannot be read, or what it says is not clear enough to drive.

    The text names the file, and the part of it: "yard.plan: item 3: latitude 91 not in -90..90".
    """


class ConfigError(UsageError):
    """A configuration that cannot be read, or whose values cannot be.

    ``faults`` has all that is wrong with it, one line each, which names where it stands.
    """

    def __init__(self, *faults: str) -> None:
        super().__init__("\n".join(faults))
        self.faults = faults


class KeyRingError(ConfigError):
    """A key ring that cannot be read or kept, or that has no such key; no secret is in the words.

    ``faults`` as those of a configuration.
    """


class SettingError(UsageError):
    """A value that a setting cannot have; the text names the setting and its range."""


class Rejection(MavTasksError):
    """A client's request refused.

    ``reason`` is a TASK_REASON number of the dialect (100 and above); the MAV_RESULT that goes on
    the wire follows from it by a table (``engine/commands/translate.py``), so that the task domain
    can refuse without knowing MAVLink. ``param`` is the parameter that is wrong, 1 to 7, 0: none.
    """

    def __init__(self, reason: int, text: str, *, param: int = 0) -> None:
        super().__init__(text)
        self.reason = reason
        self.text = text
        self.param = param


class ClientError(MavTasksError):
    """What a script asked of a task server came to nothing."""


class NoAnswer(ClientError):
    """Nobody answered in time; what was asked for may have been done all the same.

    ``nonce`` is that of a submission, 0 of anything else: submitted again with it, it is the same
    task.
    """

    def __init__(self, text: str, *, nonce: int = 0) -> None:
        super().__init__(text)
        self.nonce = nonce


class Refused(ClientError):
    """The server said no. ``reason`` is a TASK_REASON number of the dialect, 0 if it gave none.

    ``result`` is the MAV_RESULT, or of a plan the MAV_MISSION_RESULT. After a
    TEMPORARILY_REJECTED (1) the same may be asked for again later.
    """

    def __init__(self, text: str, *, result: int, reason: int) -> None:
        super().__init__(text)
        self.result = result
        self.reason = reason


class NoSuchVehicle(ClientError):
    """There is no rover of that number, or there are several and none was named."""


class TaskFailed(ClientError):
    """A task ended in another way than completed, or the server does not know it any more.

    ``state`` and ``reason`` are TASK_STATE and TASK_REASON numbers of the dialect, ``state`` 0
    (UNKNOWN) if the server does not know the task.
    """

    def __init__(self, text: str, *, task_id: int, state: int, reason: int) -> None:
        super().__init__(text)
        self.task_id = task_id
        self.state = state
        self.reason = reason


class IllegalTransition(MavTasksError):
    """A task was moved along an edge that the lifecycle table does not have."""
