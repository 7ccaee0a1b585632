"""The exceptions that this package raises on purpose; all are MavTasksErrors.

UsageError: the operator can fix it; one clear line, exit status 2. Rejection: the server refuses a
request. ClientError: a client's request failed. Received bytes never raise: they are parsed to a
value, or counted (see ``mavlink``).
"""

from errno import EADDRINUSE

#: TASK_REASONs of a request in which a value or a frame is wrong, wherever that is read
BAD_PARAMETER, BAD_FRAME = 103, 104


class MavTasksError(Exception):
    """Root of the tree."""


class UsageError(MavTasksError):
    """A usage error; the message says how to fix it."""


class LinkUrlError(UsageError):
    """A link URL could not be parsed."""


class LinkOpenError(UsageError):
    """The operating system refused to open a link."""


class InsecureLinkError(UsageError):
    """A link reachable from other machines, without a signing key."""


class StoreError(UsageError):
    """A store that cannot be opened, or whose contents cannot be read.

    Only raised at start: a later disk failure is an outcome (``StoreFailed``), not an exception.
    """


class RecordError(UsageError):
    """A record of a run that cannot be written to its folder, or that cannot be read."""


class PlanFileError(UsageError):
    """A mission file that cannot be read, or that is not clear enough to be driven.

    The text names the file and the faulty part: "yard.plan: item 3: latitude 91 not in -90..90".
    """


class ConfigError(UsageError):
    """A configuration that cannot be read, or that has invalid values.

    ``faults`` lists every fault, one line each; each line names the place.
    """

    def __init__(self, *faults: str) -> None:
        super().__init__("\n".join(faults))
        self.faults = faults


class KeyRingError(ConfigError):
    """A key ring that cannot be read or written, or that lacks a key.

    The text contains no secret. ``faults`` is as in ConfigError.
    """


class SettingError(UsageError):
    """An invalid value of a setting; the text names the setting and its range."""


class Rejection(MavTasksError):
    """A client's request was refused.

    ``reason`` is a TASK_REASON number of the dialect (100 and above). A table in
    ``engine/commands/translate.py`` maps it to the MAV_RESULT on the wire, so that the task domain
    can refuse without knowing MAVLink. ``param`` is the wrong parameter, 1 to 7; 0: none.
    """

    def __init__(self, reason: int, text: str, *, param: int = 0) -> None:
        super().__init__(text)
        self.reason = reason
        self.text = text
        self.param = param


def reason_of(error: OSError) -> str:
    """Return the system's words for an error, and what helps if an address is in use."""
    words = error.strerror or str(error)
    if error.errno == EADDRINUSE:
        words += ": end the program that has it (ss -lntup names it), or choose another"
    return words


def missing(package: str, extra: str) -> str:
    """Return the words for a package that is not installed, with the command that installs it."""
    return f"needs the package {package}: run pip install '.[{extra}]' in the folder of mav-tasks"


class ClientError(MavTasksError):
    """A client's request to a task server failed."""


class NoAnswer(ClientError):
    """No answer came in time. The server may nevertheless have done what was requested.

    ``nonce`` is the nonce of a submission, 0 for any other request. A submission that is repeated
    with its nonce does not create a second task.
    """

    def __init__(self, text: str, *, nonce: int = 0) -> None:
        super().__init__(text)
        self.nonce = nonce


class LinkDown(NoAnswer):
    """No answer came, because the link is down: no device, or nobody listens; the text says why."""


class Refused(ClientError):
    """The server refused. ``reason`` is a TASK_REASON number of the dialect, 0 if it gave none.

    ``result`` is the MAV_RESULT, or the MAV_MISSION_RESULT of a plan. After TEMPORARILY_REJECTED
    (1) the client may repeat the request later.
    """

    def __init__(self, text: str, *, result: int, reason: int) -> None:
        super().__init__(text)
        self.result = result
        self.reason = reason


class NoSuchVehicle(ClientError):
    """There is no rover of that number, or there are several and none was named."""


class TaskFailed(ClientError):
    """A task ended in another state than completed, or the server no longer knows it.

    ``state`` and ``reason`` are TASK_STATE and TASK_REASON numbers of the dialect. ``state`` is 0
    (UNKNOWN) if the server no longer knows the task.
    """

    def __init__(self, text: str, *, task_id: int, state: int, reason: int) -> None:
        super().__init__(text)
        self.task_id = task_id
        self.state = state
        self.reason = reason


class IllegalTransition(MavTasksError):
    """A bug: the lifecycle table lacks the transition that was requested for a task."""
