"""Start the comparison; handle an interrupt at any moment, even during imports."""

import sys
from importlib.util import find_spec

NO_PYMAVLINK = "compare_rovers: pymavlink is not installed: run tools/setup"
USAGE_ERROR = 2
INTERRUPTED = 130  # the shell's status for SIGINT


def main() -> int:
    """Run the comparison; return the exit status."""
    if find_spec("pymavlink") is None:
        sys.stderr.write(f"{NO_PYMAVLINK}\n")
        return USAGE_ERROR
    from rover_sim.compare.app import main as run  # noqa: PLC0415

    return run()


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.stdout.write("\ncompare_rovers: interrupted\n")
        sys.exit(INTERRUPTED)
