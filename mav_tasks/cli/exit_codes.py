"""Exit statuses and error messages of all commands. guide/tasks.md has the table.

Only this module turns an error into a message for the operator: one line on standard error.
"""

import os
import sys

from mav_tasks.basics.errors import (
    ClientError,
    NoAnswer,
    NoSuchVehicle,
    Refused,
    TaskFailed,
    UsageError,
)

DONE = 0
FAILED = 1  # a task did not complete, or a request was refused
USAGE = 2  # usage error; the message says how to fix it
NO_ANSWER = 3  # no answer in time
INTERRUPTED = 130  # Ctrl-C, as a shell reports SIGINT
READER_GONE = 141  # the reader of the output has ended, as a shell reports SIGPIPE

TABLE = """\b
Exit status:
  0  done
  1  a task did not complete, or the server refused a request
  2  usage error; the message says how to fix it
  3  no answer in time
  70  internal error of the server (serve only)
  130  Ctrl-C"""

#: expected errors of a command; any other one is a bug and shows its traceback
TOLD = (UsageError, ClientError, KeyboardInterrupt)


def tell(error: BaseException) -> int:
    """Print an error on standard error. Return the exit status."""
    match error:
        case KeyboardInterrupt():
            return INTERRUPTED
        case BrokenPipeError():
            _let_go_of_output()
            return READER_GONE
        case NoAnswer(nonce=nonce) if nonce:
            again = f"with --nonce {nonce} the same command makes no second task"
            _say(f"{error}. The task may exist: {again}")
        case NoSuchVehicle():
            _say(f"{error} (--vehicle N)")
        case Refused() | TaskFailed():
            from mav_tasks.store.rendering import in_commands  # noqa: PLC0415  # takes long

            _say("\n".join(map(in_commands, str(error).splitlines())))
        case _:
            _say(f"{error}")
    match error:
        case NoAnswer():
            return NO_ANSWER
        case Refused() | TaskFailed():
            return FAILED
        case _:
            return USAGE


def _say(text: str) -> None:
    for line in text.splitlines():  # a file may have many faults
        sys.stderr.write(f"mav-tasks: {line}\n")


def _let_go_of_output() -> None:
    """Redirect standard output to /dev/null, so that Python's flush at exit does not fail."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)
