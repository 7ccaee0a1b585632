"""Start the demonstration; handle an interrupt at any moment, even during imports."""

import signal
import sys

INTERRUPTED = 130  # the shell's status for SIGINT


def main() -> int:
    """Run the demonstration; return the exit status."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # a module in C that is imported may swallow it
    from rover_sim.demo.app import main as run  # noqa: PLC0415

    signal.signal(signal.SIGINT, signal.default_int_handler)
    return run()


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.stdout.write("\ndemo: interrupted\n")
        sys.exit(INTERRUPTED)
